"""Attributes of virtual channels: what was set reads back, what the module decides is derived."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from nidaqmx.constants import DataJustification, ResolutionType, TerminalConfiguration

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels.virtual import CHANNEL_TYPE, USAGE, VirtualChannel
from sim_hardware.daqmx_server.services.attributes import unsupported
from sim_hardware.daqmx_server.tasks.task import task_named

DEFAULTS: Final[dict[str, Any]] = {"CHAN_DESCR": "", "CHAN_IS_GLOBAL": False, "AI_CUSTOM_SCALE_NAME": ""}
"""Attributes that every channel has and that are only kept."""


def _range(channel: VirtualChannel, end: int) -> float:
    return channel.input_range_v[end] / channel.volts_per_electrical * channel.unit_per_electrical


DERIVED: Final[dict[str, Callable[[VirtualChannel], Any]]] = {
    "CHAN_TYPE": lambda channel: CHANNEL_TYPE,
    "PHYSICAL_CHAN_NAME": lambda channel: channel.physical,
    "AI_MEAS_TYPE": lambda channel: USAGE[channel.measurement],
    "AI_TERM_CFG": lambda channel: TerminalConfiguration[channel.terminal_config].value,
    "AI_RNG_LOW": lambda channel: channel.input_range_v[0],
    "AI_RNG_HIGH": lambda channel: channel.input_range_v[1],
    "AI_RESOLUTION": lambda channel: float(channel.product.bits),
    "AI_RESOLUTION_UNITS": lambda channel: ResolutionType.BITS.value,
    "AI_RAW_SAMP_SIZE": lambda channel: 8 * channel.raw_bytes,
    "AI_RAW_SAMP_JUSTIFICATION": lambda channel: DataJustification.RIGHT.value,
    "AI_DEV_SCALING_COEFF": lambda channel: [channel.converter.middle, channel.converter.step],
}


def _coupling(channel: VirtualChannel) -> int:
    return int(channel.attributes.get("AI_COUPLING", channel.default_coupling.value))


class ChannelGroup:
    """Channel attributes; a list of channels answers for its first and is set as a whole."""

    def get(self, bench: Bench, request: Any, name: str) -> Any:
        task = task_named(bench, request.task.name)
        channel = task.channels_named(request.channel)[0]
        if name in DERIVED:
            return DERIVED[name](channel)
        if name == "AI_COUPLING":
            return _coupling(channel)
        if name in channel.attributes:
            return channel.attributes[name]
        if name in DEFAULTS:
            return DEFAULTS[name]
        raise unsupported(name, f"Channel Name: {channel.name}")

    def set(self, bench: Bench, request: Any, name: str, value: Any) -> None:
        for channel in self._changing(bench, request, name):
            channel.attributes[name] = value

    def reset(self, bench: Bench, request: Any, name: str) -> None:
        for channel in self._changing(bench, request, name):
            if name in channel.created_with:
                channel.attributes[name] = channel.created_with[name]
            else:
                channel.attributes.pop(name, None)

    @staticmethod
    def _changing(bench: Bench, request: Any, name: str) -> list[VirtualChannel]:
        task = task_named(bench, request.task.name)
        channels = task.channels_named(request.channel)
        for channel in channels:
            if name not in channel.settable:
                raise unsupported(name, f"Channel Name: {channel.name}")
        task.configure()
        return channels

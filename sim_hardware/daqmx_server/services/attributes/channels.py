"""Attributes of virtual channels: what was set reads back, what the device decides is derived."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from nidaqmx import constants

from daq_app.config.hardware.products import Range
from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels import metadata
from sim_hardware.daqmx_server.channels.analog_input import AnalogInput
from sim_hardware.daqmx_server.channels.virtual import CHANNEL_TYPES, USAGES, VirtualChannel
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.services.attributes.groups import unsupported
from sim_hardware.daqmx_server.tasks.task import Task, task_named

_GROUP: Final = "Chan"
_MEASUREMENT: Final = {
    "AI": "AI_MEAS_TYPE",
    "AO": "AO_OUTPUT_TYPE",
    "CI": "CI_MEAS_TYPE",
    "CO": "CO_OUTPUT_TYPE",
}
_ABSENT: Final = frozenset({"AI_SENSOR_POWER_CFG", "AI_IMPEDANCE", "AI_DITHER_ENABLE", "AI_AUTO_ZERO_MODE"})
"""Attributes that need hardware which none of the products has."""


def _reading_range(channel: AnalogInput, end: int) -> float:
    """End of the input range in the unit of the reading: what AI.Max reads back once the range is known."""
    if not channel.has_limits:
        missing = Code.NO_MINIMUM if "AI_MAX" in channel.attributes else Code.NO_MAXIMUM
        raise DaqmxError(missing, f"Channel Name: {channel.name}")
    volts = channel.input_range[end] / channel.volts_per_electrical
    value = volts * channel.unit_per_electrical
    return value if channel.scale is None else float(channel.scale.forward(np.array(value)))


_DERIVED_AI: Final[dict[str, Callable[[AnalogInput], Any]]] = {
    "AI_TERM_CFG": lambda channel: constants.TerminalConfiguration[channel.terminal_config].value,
    "AI_MIN": lambda channel: _reading_range(channel, 0),
    "AI_MAX": lambda channel: _reading_range(channel, 1),
    "AI_RNG_LOW": lambda channel: channel.input_range[0],
    "AI_RNG_HIGH": lambda channel: channel.input_range[1],
    "AI_RESOLUTION": lambda channel: float(channel.product.bits),
    "AI_RESOLUTION_UNITS": lambda channel: constants.ResolutionType.BITS.value,
    "AI_RAW_SAMP_SIZE": lambda channel: 8 * channel.raw_bytes,
    "AI_RAW_SAMP_JUSTIFICATION": lambda channel: constants.DataJustification.RIGHT.value,
    "AI_DEV_SCALING_COEFF": lambda channel: [channel.converter.middle, channel.converter.step],
    "AI_COUPLING": lambda channel: int(channel.attributes.get("AI_COUPLING", channel.default_coupling.value)),
    "AI_IS_TEDS": lambda channel: channel.kind.teds,
}
_DERIVED_AO: Final[dict[str, Callable[[VirtualChannel], Any]]] = {
    "AO_RESOLUTION": lambda channel: float(channel.product.outputs.bits),
    "AO_RESOLUTION_UNITS": lambda channel: constants.ResolutionType.BITS.value,
    "AO_DAC_RNG_LOW": lambda channel: _output_range(channel)[0],
    "AO_DAC_RNG_HIGH": lambda channel: _output_range(channel)[1],
    "AO_TERM_CFG": lambda channel: constants.TerminalConfiguration.RSE.value,
    "AO_DEV_SCALING_COEFF": lambda channel: [0.0, _codes_per_volt(channel)],
}


def _output_range(channel: VirtualChannel) -> Range:
    """Smallest range of the output that holds what was asked for; the widest where none does."""
    outputs = channel.product.outputs
    ranges = outputs.ranges_a if channel.measurement == "CURRENT" else outputs.ranges_v
    low, high = float(channel.attributes.get("AO_MIN", 0.0)), float(channel.attributes.get("AO_MAX", 1.0))
    return next((pair for pair in ranges if pair[0] <= low and high <= pair[1]), ranges[-1])


def _codes_per_volt(channel: VirtualChannel) -> float:
    outputs = channel.product.outputs
    return 2.0 ** (outputs.bits - 1) / max(abs(end) for end in _output_range(channel))


_DEFAULTS: Final[dict[str, Any]] = {
    "PWR_IDLE_OUTPUT_BEHAVIOR": constants.PowerIdleOutputBehavior.MAINTAIN_EXISTING_VALUE.value,
    "AI_RTD_A": 3.81e-3,
    "AI_RTD_B": -6.02e-7,
    "AI_RTD_C": -6.0e-12,
    "AI_LOSSY_LSB_REMOVAL_COMPRESSED_SAMP_SIZE": 16,
    "CI_CTR_TIMEBASE_SRC": "100MHzTimebase",
    "CO_CTR_TIMEBASE_SRC": "100MHzTimebase",
    "CO_COUNT": 0,
    **{
        name: "100MHzTimebase"
        for name in metadata.attributes_of(_GROUP)
        if name.endswith("_DIG_FLTR_TIMEBASE_SRC")
    },
}
"""Defaults that are not the zero of their type (RTD: the coefficients of the Pt 3750 curve)."""
_SETTABLE_DERIVED: Final = frozenset(
    {"AI_TERM_CFG", "AI_MIN", "AI_MAX", "AI_RNG_LOW", "AI_RNG_HIGH", "AI_COUPLING"}
)
_DIGITAL_LINES: Final = ("DI_NUM_LINES", "DO_NUM_LINES")


def _derived(channel: VirtualChannel, name: str) -> Any:
    """Value of an attribute that follows from the channel; None for one that does not."""
    if name == "CHAN_TYPE":
        return CHANNEL_TYPES[channel.io]
    if name == "PHYSICAL_CHAN_NAME":
        return channel.physical
    if name == "CHAN_IS_GLOBAL":
        return channel.is_global
    if name == _MEASUREMENT.get(channel.io):
        return USAGES[channel.io][channel.measurement]
    if name in _DIGITAL_LINES:
        return len(channel.lines)
    if isinstance(channel, AnalogInput) and name in _DERIVED_AI:
        return _DERIVED_AI[name](channel)
    if channel.io == "AO" and name in _DERIVED_AO:
        return _DERIVED_AO[name](channel)
    return None


class ChannelGroup:
    """Channel attributes; a list of channels answers for its first and is set as a whole."""

    def get(self, bench: Bench, request: Any, name: str) -> Any:
        task = task_named(bench, request.task.name)
        channel = _named(task, request.channel)[0]
        self._check(channel, name)
        value = _derived(channel, name)
        if value is None:
            value = task.live_value(channel, name)
        if value is None:
            value = channel.attributes.get(name, _DEFAULTS.get(name))
        return metadata.default_of(_GROUP, name) if value is None else value

    def set(self, bench: Bench, request: Any, name: str, value: Any) -> None:
        task = task_named(bench, request.task.name)
        channels = _named(task, request.channel)
        for channel in channels:
            self._check(channel, name, setting=True)
            if isinstance(value, int) and not metadata.is_value(_GROUP, name, value):
                raise channel.refuse(f"DAQmx_{name}", value, [])
        task.configure()
        for channel in channels:
            channel.attributes[name] = value

    def reset(self, bench: Bench, request: Any, name: str) -> None:
        task = task_named(bench, request.task.name)
        channels = _named(task, request.channel)
        for channel in channels:
            self._check(channel, name, setting=True)
        task.configure()
        for channel in channels:
            channel.attributes.pop(name, None)

    @staticmethod
    def _check(channel: VirtualChannel, name: str, setting: bool = False) -> None:
        """−200452 for an attribute that the channel does not have, or that cannot be set."""
        known = name in metadata.attributes_of(_GROUP) and channel.applies(name)
        read_only = setting and (
            name not in metadata.resettable(_GROUP) or (name in _DERIVED_AI and name not in _SETTABLE_DERIVED)
        )
        if not known or name in _ABSENT or read_only:
            raise unsupported(name, f"Channel Name: {channel.name}")


def _named(task: Task, names: str) -> list[VirtualChannel]:
    channels = task.channels_named(names)
    if not channels:
        raise DaqmxError(Code.NO_CHANNELS)
    return channels

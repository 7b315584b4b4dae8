"""Calls that balance and shunt bridges: simulated bridges are balanced, and read what a shunt should give."""

from __future__ import annotations

from typing import Any, Final

from nidaqmx._stubs import nidaqmx_pb2 as pb

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.services.attributes.groups import Handler, unsupported
from sim_hardware.daqmx_server.tasks.task import task_named

_BRIDGES: Final = ("BRIDGE", "STRAIN")
_CALLS: Final = {
    "PerformBridgeOffsetNullingCalEx": ("AI_BRIDGE_INITIAL_RATIO", 0.0, _BRIDGES),
    "PerformBridgeShuntCalEx": ("AI_BRIDGE_SHUNT_CAL_GAIN_ADJUST", 1.0, _BRIDGES),
    "PerformStrainShuntCalEx": ("AI_BRIDGE_SHUNT_CAL_GAIN_ADJUST", 1.0, _BRIDGES),
    "PerformThrmcplLeadOffsetNullingCal": ("AI_THRMCPL_LEAD_OFFSET_VOLTAGE", 0.0, ("THERMOCOUPLE",)),
}
"""RPC → the attribute that it determines, its value, and words in the names of the measurements."""


def _handler(rpc: str) -> Handler:
    attribute, value, words = _CALLS[rpc]
    reply = getattr(pb, f"{rpc}Response")

    def calibrate(bench: Bench, request: Any) -> Any:
        task = task_named(bench, request.task.name)
        for channel in task.channels_named(request.channel):
            if any(word in channel.measurement for word in words):
                channel.attributes[attribute] = value
            elif not request.skip_unsupported_channels:
                raise unsupported(attribute, f"Channel Name: {channel.name}")
        return reply()

    return calibrate


def bridge_handlers() -> dict[str, Handler]:
    """RPC name → handler."""
    return {rpc: _handler(rpc) for rpc in _CALLS}

"""A task that is made only to be asked: what a converter is like, which no attribute of its device tells."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import nidaqmx
from nidaqmx import errors as ni_errors
from nidaqmx.constants import ExcitationSource, ResistanceConfiguration

from drivers.ni.connection import Connection

_DEFAULT_BITS: Final = 16
_EXCITATION_V: Final = 2.5


@dataclass(frozen=True, slots=True)
class Probe:
    """What a channel told."""

    bits: int = _DEFAULT_BITS
    timebase_hz: float = 0.0
    """The clock that the sample clock is divided from."""
    has_timing_modes: bool = False
    """Whether the converter trades speed for resolution."""


def probe(
    way: Connection, channel: str, usages: Sequence[str], ranges: Mapping[str, Sequence[Sequence[float]]]
) -> Probe:
    """Ask a channel; an output where `usages` is empty. Reserves nothing, and starts nothing."""
    task = way.new_task("product_probe")
    try:
        return _output(task, channel, ranges) if not usages else _input(task, channel, usages, ranges)
    except ni_errors.DaqError:
        return Probe()
    finally:
        task.close()


def _output(task: nidaqmx.Task, channel: str, ranges: Mapping[str, Sequence[Sequence[float]]]) -> Probe:
    quantity, pairs = next(iter(ranges.items()))
    low, high = pairs[-1]
    add = getattr(task.ao_channels, f"add_ao_{quantity}_chan")
    return Probe(round(add(channel, min_val=low, max_val=high).ao_resolution))


def _input(
    task: nidaqmx.Task, channel: str, usages: Sequence[str], ranges: Mapping[str, Sequence[Sequence[float]]]
) -> Probe:
    created = _created(task, channel, usages, ranges)
    if created is None:
        return Probe()
    try:
        has_modes = created.ai_adc_timing_mode is not None
    except ni_errors.DaqError:
        has_modes = False
    bits = round(created.ai_resolution)
    try:
        task.timing.cfg_samp_clk_timing(1.0)
        return Probe(bits, float(task.timing.samp_clk_timebase_rate), has_modes)
    except ni_errors.DaqError:
        return Probe(bits, 0.0, has_modes)


def _created(
    task: nidaqmx.Task, channel: str, usages: Sequence[str], ranges: Mapping[str, Sequence[Sequence[float]]]
) -> Any:
    """A channel of the measurement that asks for the least, of those that the device has; None for none."""
    inputs = task.ai_channels

    def limits(quantity: str) -> dict[str, float]:
        low, high = ranges[quantity][-1] if ranges.get(quantity) else (-1.0, 1.0)
        return {"min_val": low, "max_val": high}

    ways: dict[str, Callable[[], Any]] = {
        "VOLTAGE": lambda: inputs.add_ai_voltage_chan(channel, **limits("voltage")),
        "CURRENT": lambda: inputs.add_ai_current_chan(channel, **limits("current")),
        "TEMPERATURE_THERMOCOUPLE": lambda: inputs.add_ai_thrmcpl_chan(channel),
        "RESISTANCE": lambda: inputs.add_ai_resistance_chan(
            channel,
            **limits("resistance"),
            resistance_config=ResistanceConfiguration.FOUR_WIRE,
            current_excit_source=ExcitationSource.INTERNAL,
        ),
        "BRIDGE": lambda: inputs.add_ai_bridge_chan(
            channel, **limits("bridge"), voltage_excit_val=_EXCITATION_V
        ),
        "CHARGE": lambda: inputs.add_ai_charge_chan(channel, **limits("charge")),
        "POSITION_LINEAR_LVDT": lambda: inputs.add_ai_pos_lvdt_chan(channel),
    }
    make = next((make for usage, make in ways.items() if usage in usages), None)
    return None if make is None else make()

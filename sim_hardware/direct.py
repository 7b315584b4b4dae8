"""A whole test without real time: the readings that the simulated device server would have given."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config.hardware import catalogue
from daq_app.config.hardware.inventory import devices_of
from daq_app.config.planning.plan import PlannedChannel, TaskPlan
from daq_app.config.rig import Channel, Rig
from sim_hardware.daqmx_server.channels.converter import Converter
from sim_hardware.dynamics.motion import simulate_vector
from sim_hardware.sensors.rows import excitation_v
from sim_hardware.simulated_test import Engine
from sim_hardware.virtual_rig import DEFAULT_LEVEL, VirtualRig

_BLOCK: Final = 8_000
_NO_EFFECTS: Final[Mapping[str, Mapping[str, float]]] = {}


@dataclass(frozen=True, slots=True)
class SynthesisedTest:
    """A simulated test from power-on to some time after rest."""

    readings: NDArray[np.float64]
    """(channels, samples), rig order, unit `Channel.reading_unit`: skewed, delayed, quantised, clipped."""
    rate_hz: float
    first_sample: int
    """Always 0: sample k is the one at k / rate since power-on."""
    truth: dict[str, object]
    """`SimulatedTest.truth`: θ₀, r, impacts …, times since power-on."""
    upright_samples: int
    """Samples of the untouched wall at the start, from which the zero may be taken."""
    release_sample: int


def synthesise_test(
    rig: Rig,
    plan: TaskPlan,
    theta0_over_alpha: float = DEFAULT_LEVEL,
    seed: int | None = None,
    *,
    restitution: float | None = None,
    effects: Mapping[str, Mapping[str, float]] = _NO_EFFECTS,
    impacts_before: int = 0,
    post_rest_s: float | None = None,
    engine: Engine = simulate_vector,
) -> SynthesisedTest:
    """One scripted test of the rig's simulated wall at the level θ₀/α, through the plan's converters.

    None means what the rig file says.  The samples are those of the simulated device server for the
    same rig, seed and level, where `engine`, which moves the wall, is not another one.  `ValueError`
    in words for a level, restitution or effect that makes no sense.
    """
    wall = VirtualRig(
        rig,
        seed=rig.simulation.seed if seed is None else seed,
        theta0_over_alpha=theta0_over_alpha,
        restitution=restitution,
        effects=effects,
        impacts_before=impacts_before,
        engine=engine,
    )
    test = wall.tests[-1]
    after = rig.acquisition.post_rest_s if post_rest_s is None else post_rest_s
    n = math.ceil((test.release_s + test.motion.end_s + after) * plan.rate_hz)
    readings = np.empty((len(rig.channels), n))
    for offset_s, group in _by_offset(plan).items():
        _fill_group(wall, rig, group, offset_s, plan.rate_hz, readings)
    return SynthesisedTest(
        readings,
        plan.rate_hz,
        0,
        test.truth(),
        int(rig.simulation.upright_s * plan.rate_hz),
        round(test.release_s * plan.rate_hz),
    )


def _by_offset(plan: TaskPlan) -> dict[float, list[PlannedChannel]]:
    """Channels whose samples show the same instants."""
    groups: dict[float, list[PlannedChannel]] = {}
    for task in plan.tasks:
        for planned in task.channels:
            groups.setdefault(planned.time_offset_s, []).append(planned)
    return groups


def _fill_group(
    wall: VirtualRig,
    rig: Rig,
    group: list[PlannedChannel],
    offset_s: float,
    rate_hz: float,
    readings: NDArray[np.float64],
) -> None:
    terminals = tuple(planned.channel.physical_channel for planned in group)
    converters = [converter_of(rig, planned.channel) for planned in group]
    middle = np.array([[converter.middle] for converter in converters])
    step = np.array([[converter.step] for converter in converters])
    low, high = np.array([converter.code_limits for converter in converters], dtype=np.float64).T[:, :, None]
    per_reading = np.array([[electrical_per_reading(planned.channel)] for planned in group])
    rows = [planned.rig_index for planned in group]
    n = readings.shape[1]
    for start in range(0, n, _BLOCK):
        stop = min(start + _BLOCK, n)
        values = wall.volts(terminals, np.arange(start, stop) / rate_hz + offset_s)
        values -= middle
        values *= 1.0 / step
        np.rint(values, out=values)
        np.clip(values, low, high, out=values)
        values *= step
        values += middle
        values /= per_reading
        readings[rows, start:stop] = values


def electrical_per_reading(channel: Channel) -> float:
    """Electrical units at the terminal per unit of the reading (1 where the reading is in volts)."""
    if not channel.scaled_by_driver or channel.measurement == "thermocouple":
        return 1.0
    return channel.sensitivity_v_per_si / excitation_v(channel)


def converter_of(rig: Rig, channel: Channel) -> Converter:
    """The converter behind a channel, in the electrical quantity; `LookupError` without its device."""
    devices, _ = devices_of(rig.hardware)
    name = channel.physical_channel.partition("/")[0]
    device = devices.get(name)
    if device is None:
        raise LookupError(f"{channel.id}: the rig's hardware has no device {name!r}")
    low, high = channel.input_range_v
    volts_per_electrical = 1.0
    if channel.measurement == "lvdt_native":
        volts_per_electrical = channel.excitation.value or 1.0
        to_volts = electrical_per_reading(channel) * volts_per_electrical
        low, high = channel.range_si[0] * to_volts, channel.range_si[1] * to_volts
    if channel.measurement == "thermocouple":
        return Converter(*channel.range_si, device.product.bits)
    range_low, range_high = catalogue.coerce_range(device.product, low, high, channel.measurement)
    scale = 1.0 / volts_per_electrical
    return Converter(range_low * scale, range_high * scale, device.product.bits)

"""Ring-downs of the wall after impacts, from soft beds to squat walls."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, lsim, sosfiltfilt

from daq_app.gap.core.fitting.fit import fit
from daq_app.gap.rocking_model.features.block import Block, Shares
from daq_app.gap.rocking_model.features.oscillations.ring_signals import Signal
from daq_app.gap.rocking_model.features.oscillations.rings import Ring, ring_block, scan
from daq_app.gap.rocking_model.motion.rotation import joint_rotation
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.study import model_and_library, prepare
from tests.support.simulated_wall import simulate


def _bending(frequency_hz: float) -> tuple[Block, float]:
    """The block of the bending wall, and the kick that its wires show."""
    effects = {"flexible_wall": {"gain": 0.02, "frequency": frequency_hz, "zeta": 0.03}}
    (run,) = prepare(simulate(effects, (0.3,)))[0]
    block = next(b for b in run.blocks if b.kind == "bending")
    return block, float(block.values[block.names.index("sine in wires")])


@pytest.mark.parametrize("frequency_hz", [2.9, 4.6, 30.0])
def test_a_wall_that_rings_is_heard_from_2_to_42_hz(frequency_hz: float) -> None:
    block, kick = _bending(frequency_hz)
    assert block.values[block.names.index("frequency")] == pytest.approx(frequency_hz, rel=0.03)
    assert kick == pytest.approx(0.02, rel=0.2)


def test_the_library_lets_walls_ring_where_they_are_looked_for() -> None:
    library = model_and_library(prepare(simulate({}, (0.3,)))[0])[1]
    frequency = next(p for p in library["flexible_wall"].parameters if p.name == "frequency")
    assert frequency.low < 2.9 < 42.0 < frequency.high


def _bent_by_inertia(run: GapRun, length_m: float, frequency_hz: float, zeta: float) -> None:
    """Add q (z/H)² to wires and accelerometers: q̈ + 2ζω q̇ + ω² q = −L θ̈, impacts and all.

    q + L θ is driven by L θ alone, so that no derivative of a measured rotation is needed.
    """
    measured = joint_rotation(run).theta.copy()
    released = int(np.flatnonzero(np.abs(measured) > 0.99 * np.abs(measured).max())[-1])
    measured[:released] = measured[released - 400 : released].mean()
    theta = sosfiltfilt(butter(4, 25.0, fs=run.rate_hz, output="sos"), measured)
    time_s = np.arange(theta.size) / run.rate_hz
    natural = 2.0 * np.pi * frequency_hz
    numerator = [2.0 * zeta * natural, natural**2]
    start = length_m * theta[0]
    driven = lsim((numerator, [1.0, *numerator]), length_m * theta - start, time_s)[1] + start
    place = driven - length_m * theta
    acceleration = np.gradient(np.gradient(place, time_s), time_s)
    for i, sensor in enumerate(run.sensors):
        share = (sensor.position_m[2] / run.survey.height_m) ** 2
        if sensor.family == "wire":
            run.channels[i] += share * (place - place[-1])
        elif sensor.family == "accelerometer" and sensor.axis == "x":
            run.channels[i] += share * acceleration


def test_a_wall_that_its_own_inertia_bends_is_a_wall_that_rings() -> None:
    runs = simulate({}, (-0.25, 0.2))
    for run in runs:
        _bent_by_inertia(run, 1.5, 4.6, 0.01)
    prepared = prepare(runs)[0]
    model, library = model_and_library(prepared)
    stiff = fit(model, prepared)
    bent = fit(model, prepared, (library["flexible_wall"],), stiff.known())
    values = {name: value for name, (value, _, _) in bent.values.items()}
    assert bent.log_evidence > stiff.log_evidence + 10.0
    assert values["flexible_wall.frequency"] == pytest.approx(4.6, rel=0.03)
    assert values["flexible_wall.gain"] * 2.0 * np.pi * 4.6 == pytest.approx(1.5, rel=0.3)
    assert values["flexible_wall.forced"] > 0.6


@pytest.mark.parametrize("slow", [True, False])
def test_a_signal_of_which_impacts_leave_nothing_says_nothing(slow: bool) -> None:
    """Late accelerometers on a wall that stays on its joint at every impact have no clean sample."""
    grid = prepare(simulate({}, (0.25, -0.35)))[0][0].grid
    nothing = np.zeros(grid.time_s.size, dtype=bool)
    signal = Signal("accelerometer", grid.theta, nothing, Shares(yaw=1.0))
    assert ring_block("turning", grid, [signal], Ring(5.0, 0.02, 10.0, 0.1, 0.1), slow=slow) is None
    assert scan([grid], [[signal]], slow=slow) is None

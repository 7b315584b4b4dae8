"""Vibrations of the floor: found where the wall stands still, told from what the wall itself does there."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.study import model_and_library, prepare
from tests.support.simulated_wall import simulate

LEVELS = (0.25, -0.35)


def _prepared(effects: dict[str, dict[str, float]], levels: tuple[float, ...] = LEVELS) -> list[RockingRun]:
    return prepare(simulate(effects, levels))[0]


def _value(run: RockingRun, family: str, name: str) -> float:
    block = next(b for b in run.blocks if b.family == family)
    return float(block.values[block.names.index(name)])


def test_ring_down_and_floor_are_seen_at_their_frequency() -> None:
    runs = _prepared(
        {
            "flexible_wall": {"gain": 0.004, "frequency": 16.0, "zeta": 0.025},
            "ambient": {"amplitude": 0.08, "frequency": 2.3},
        }
    )
    for run in runs:
        assert _value(run, "bending", "frequency") == pytest.approx(16.0, rel=0.02)
        assert _value(run, "bending", "sine in accelerometers") == pytest.approx(-0.004, rel=0.25)
        assert _value(run, "floor", "amplitude") == pytest.approx(0.08, rel=0.15)
        assert _value(run, "floor", "frequency") == pytest.approx(2.3, abs=0.05)
    assert "ambient" in model_and_library(runs)[1]


def test_the_phase_of_the_floor_is_read_after_the_rest_where_the_hold_is_spoilt() -> None:
    """A quick pull or footsteps leave nothing to read while the wall is held."""
    runs = simulate({"ambient": {"amplitude": 0.08, "frequency": 2.3}}, LEVELS)
    clean, _ = prepare(runs)
    shaken = runs[0].channels[runs[0].indices("accelerometer")]
    before = round((clean[0].swings.release_s - 0.05) * runs[0].rate_hz) + runs[0].channels.shape[1]
    before -= round((clean[0].grid.time_s[-1] + clean[0].swings.release_s) * runs[0].rate_hz)
    shaken[:, :before] += 0.8 * np.random.default_rng(5).standard_normal(shaken[:, :before].shape)
    runs[0].channels[runs[0].indices("accelerometer")] = shaken
    spoilt = prepare(runs)[0][0].vibration
    whole = clean[0].vibration
    assert spoilt is not None
    assert whole is not None
    assert abs(spoilt.phase - whole.phase) < 3.0 * spoilt.phase_sd + 0.05
    assert 0.0 < spoilt.phase_sd < 0.2


def test_a_wall_that_sways_on_its_joint_at_rest_is_no_vibration_of_the_floor() -> None:
    """A compliant joint makes a pendulum of the wall, which the accelerometers see after the last impact."""
    runs = _prepared({"winkler": {"theta_c": 8e-4}})
    assert all(run.vibration is not None and not run.vibration.found for run in runs)


def test_a_wall_that_rings_on_at_rest_is_no_vibration_of_the_floor_and_no_burst() -> None:
    """Bending at 2.7 Hz with little damping goes on for seconds after the last impact."""
    ringing = {"flexible_wall": {"gain": 0.02, "frequency": 2.7, "zeta": 0.007}}
    for run in _prepared(ringing):
        assert run.vibration is not None
        shown = run.vibration.amplitude if run.vibration.found else 0.0
        assert shown < 0.02
        assert not any(finding.key == "shaking@floor" for finding in run.findings)


def test_a_floors_wave_in_the_accelerometers_is_no_calibration_of_theirs() -> None:
    """Its share is found while the wall stands and taken out: what is left is the wall's own motion."""
    for run in _prepared({"ambient": {"amplitude": 0.1, "frequency": 0.9}}):
        assert run.vibration is not None and run.vibration.found
        assert abs(_value(run, "accelerometer", "gain of inertia")) < 6e-3

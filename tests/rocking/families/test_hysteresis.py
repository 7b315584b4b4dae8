"""A wire of several that sticks is told from sound ones by its loop; noise, gains and delays make none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from daq_app.config import load_rig
from daq_app.rocking import AnalysisOptions, analyse_record
from daq_app.rocking.families.channels.hysteresis import sticking_wire
from studies.restitution.faults import Fault
from studies.restitution.laboratory import draw_test

Floats = NDArray[np.float64]

RIG = Path(__file__).parents[3] / "configs" / "fr1.toml"
OPTIONS = AnalysisOptions(bias_runs=0, fit=False, keep_series=False)
LEVER_M = np.array([0.9, 1.5, 2.1, 2.8, 2.8])
NOISE_M = np.full(5, 2e-4)
TIME_S = np.arange(1400) * 0.005
MOTION_RAD = 0.06 * np.cos(9.0 * TIME_S) * np.exp(-0.25 * TIME_S)
"""Rotation of all wires in means of 5 ms."""


def wires(rng: np.random.Generator, noise_m: float = 4.5e-5) -> Floats:
    """What five sound wires show, each with a gain, a delay, a zero that moves and crosstalk of its own."""
    speed, curve = np.gradient(MOTION_RAD, 0.005), np.abs(MOTION_RAD)
    shown = [
        (1.0 + 0.003 * rng.standard_normal()) * MOTION_RAD
        + 0.0005 * rng.standard_normal() * speed
        + 2e-4 * rng.standard_normal() * TIME_S / TIME_S[-1]
        + 0.004 * rng.standard_normal() * curve
        for _ in LEVER_M
    ]
    return np.array(shown) + noise_m / LEVER_M[:, None] * rng.standard_normal((5, TIME_S.size))


def stuck(rotation_rad: Floats, lever_m: float, play_m: float) -> Floats:
    """The rotation that a wire with play shows."""
    shown_m, followed = float(rotation_rad[0]) * lever_m, []
    for value in (rotation_rad * lever_m).tolist():
        shown_m = min(max(shown_m, value - play_m / 2.0), value + play_m / 2.0)
        followed.append(shown_m)
    return np.array(followed) / lever_m


@pytest.mark.parametrize("place", range(5))
def test_the_wire_that_sticks_is_found_with_the_width_of_its_loop(place: int) -> None:
    shown = wires(np.random.default_rng(place))
    shown[place] = stuck(shown[place], LEVER_M[place], 1.5e-3)
    found = sticking_wire(shown, LEVER_M, NOISE_M)

    assert found is not None and found[0] == place
    # Noise that goes to and fro within the play takes a part of it.
    assert 1.1e-3 < found[1].width_m < 1.55e-3


@pytest.mark.parametrize("noise_m", [1e-5, 4.5e-5, 3e-4])
def test_sound_wires_are_not_named(noise_m: float) -> None:
    for seed in range(20):
        assert sticking_wire(wires(np.random.default_rng(seed), noise_m), LEVER_M, NOISE_M) is None


def test_a_wall_that_turns_two_wires_opposite_ways_names_neither() -> None:
    """A twist that hangs on the way of the motion: no wire sticks."""
    shown = wires(np.random.default_rng(1))
    lag = stuck(MOTION_RAD, 2.8, 1.5e-3) - MOTION_RAD
    shown[3] += lag
    shown[4] -= lag
    assert sticking_wire(shown, LEVER_M, NOISE_M) is None


def test_two_wires_tell_nothing() -> None:
    assert sticking_wire(wires(np.random.default_rng(1))[:2], LEVER_M[:2], NOISE_M[:2]) is None


@pytest.mark.parametrize(("kind", "size_m"), [("sticks", 1e-3), ("sticks", 2e-3), ("jumps", 2e-3)])
def test_a_wire_of_a_recording_that_sticks_is_left_out_and_named(kind: str, size_m: float) -> None:
    """One of five, it moved r by EAV by up to 0.02."""
    test = draw_test(load_rig(RIG), 78502)
    sound = analyse_record(test.record(), OPTIONS)
    analysis = analyse_record(Fault("wire", kind, size_m, single=4).record(test), OPTIONS)
    (finding,) = [f for f in analysis.findings if f.severity == "warning"]

    assert (finding.kind, finding.channels) == ("hysteresis", ("WP-5",)) and "sticks" in finding.text
    assert analysis.verdict.trust == "remarks" and analysis.verdict.left_out == ("WP-5",)
    assert analysis.verdict.r == pytest.approx(sound.verdict.r, abs=0.001)


@pytest.mark.parametrize("play_m", [0.002, 0.003])
def test_r_without_a_wire_that_sticks_halfway_up_is_that_of_the_sound_test(play_m: float) -> None:
    test = draw_test(load_rig(RIG), 98001)
    sound = analyse_record(test.record(), OPTIONS)
    analysis = analyse_record(Fault("wire", "sticks", play_m, single=2).record(test), OPTIONS)
    (finding,) = [f for f in analysis.findings if f.severity == "warning"]

    assert finding.channels == ("WP-3",) and "sticks" in finding.text
    assert analysis.verdict.trust == "remarks" and analysis.verdict.left_out == ("WP-3",)
    assert analysis.verdict.r == pytest.approx(sound.verdict.r, abs=0.0005)


@pytest.mark.parametrize(("kind", "size"), [("slow", 0.02), ("late", 0.02), ("gain", 0.02), ("drift", 1e-3)])
def test_a_wire_with_another_fault_is_not_said_to_stick(kind: str, size: float) -> None:
    test = draw_test(load_rig(RIG), 78502)
    analysis = analyse_record(Fault("wire", kind, size, single=2).record(test), OPTIONS)
    kinds = {f.kind for f in analysis.findings if f.channels == ("WP-3",)}
    assert kinds and "hysteresis" not in kinds

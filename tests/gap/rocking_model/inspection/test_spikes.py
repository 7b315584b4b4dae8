"""Lone samples of accelerometers are told from the shocks of impacts, however short these are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from daq_app.gap.rocking_model.findings import findings_of
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.study import prepare
from tests.support.simulated_wall import simulate

LEVELS = (0.25, -0.35)
PER_S = 2.0
TIMES_NOISE = 60.0


def _words(runs: Sequence[GapRun]) -> str:
    return "; ".join(finding.words for finding in findings_of(prepare(runs)[0]) if finding.material)


def _add(run: GapRun, names: Sequence[str], at: np.ndarray[tuple[int], np.dtype[np.intp]]) -> None:
    """Let single samples of some channels stand out."""
    for index, sensor in enumerate(run.sensors):
        if sensor.id in names:
            run.channels[index, at] += TIMES_NOISE * sensor.noise_si


def test_lone_samples_of_accelerometers_are_found() -> None:
    runs = simulate({}, LEVELS)
    rng = np.random.default_rng(11)
    for run in runs:
        n = run.channels.shape[1]
        for name in ("AC-4", "AC-7"):
            _add(run, [name], rng.integers(0, n, round(PER_S * n / run.rate_hz)))
    assert "1.9 lone samples a second in the accelerometers" in _words(runs)


def test_an_impact_that_shakes_for_one_sample_is_no_fault_of_the_accelerometers() -> None:
    runs = simulate({}, LEVELS)
    for run in runs:
        turned = run.channels[run.indices("wire")[0]]
        impacts = np.flatnonzero(np.diff(np.sign(turned - turned[-100:].mean())))
        assert impacts.size / (turned.size / run.rate_hz) > PER_S
        _add(run, [sensor.id for sensor in run.sensors if sensor.family == "accelerometer"], impacts)
    assert "lone samples" not in _words(runs)


def test_lone_samples_that_come_with_the_motion_alone_are_no_fault_of_a_channel() -> None:
    runs = simulate({}, (*LEVELS, 0.3, -0.3, 0.35, -0.25))
    rng = np.random.default_rng(12)
    for run in runs:
        turned = run.channels[run.indices("wire")[0]]
        turned = turned - turned[-100:].mean()
        rocking = np.flatnonzero(np.abs(turned) > 0.05 * np.abs(turned).max())
        impacts = np.flatnonzero(np.diff(np.sign(turned)))
        beside = impacts[(impacts > rocking[0]) & (impacts < rocking[-1])]
        # The flank of a shock that the others do not show, and what a cable does that it shakes.
        after = beside + rng.integers(round(0.04 * run.rate_hz), round(0.15 * run.rate_hz), beside.size)
        assert after.size / (turned.size / run.rate_hz) > 0.5 * PER_S
        _add(run, ["AC-5"], after)
    assert "lone samples" not in _words(runs)

"""A floor that shakes at many frequencies is measured at rest, and its part in the motion is no effect."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.findings import findings_of
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ
from daq_app.gap.rocking_model.prediction.model import FLOOR
from daq_app.gap.rocking_model.records import load_run
from daq_app.gap.rocking_model.study import diagnose_prepared, model_and_library, prepare
from daq_app.gap.rocking_model.tolerances.motion import KNOCK_S
from tests.support.gap.blind_case import blind_case
from tests.support.gap.simulated_campaign import campaign
from tests.support.simulated_wall import short_rig, simulate

SEED = 12


def _case(folder: Path, hidden: str) -> tuple[list[RockingRun], dict[str, float]]:
    """The runs of a case of an ordinary laboratory, and the parameters of what it hides."""
    files, parameters = blind_case(folder, "ordinary", hidden, seed=SEED, runs=3)
    return prepare([load_run(file) for file in files])[0], parameters


@pytest.fixture(scope="module")
def shaken(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[RockingRun], dict[str, float]]:
    return _case(tmp_path_factory.mktemp("shaken"), "irregular_floor")


def test_its_size_is_that_of_the_floor(shaken: tuple[list[RockingRun], dict[str, float]]) -> None:
    runs, floor = shaken
    (finding,) = [f for f in findings_of(runs) if f.name == "ambient@floor"]

    assert finding.size == pytest.approx(np.sqrt(2.0) * floor["rms_m_s2"], rel=0.2)
    assert finding.material and finding.family == "ambient"
    assert "irregular vibration of the floor" in finding.words
    assert not any(f.name == "shaking@floor" for f in findings_of(runs))


def test_what_the_sway_takes_of_a_floor_is_given_back() -> None:
    """The wall's own sway is taken out of its accelerometers, and some of the floor with it."""
    calm = campaign(short_rig(), short_rig(), {}, 1, (0.25, -0.35, 0.3), post_rest_s=8.0)
    band = butter(4, (2.0, 7.0), "bandpass", fs=calm[0].rate_hz, output="sos")
    found = []
    for seed in (0, 1, 3):
        rng, runs, true = np.random.default_rng(seed), [], []
        for run in calm:
            channels, aside = run.channels.copy(), round(5.0 * run.rate_hz)
            floor = sosfiltfilt(band, rng.standard_normal(channels.shape[1] + 2 * aside))[aside:-aside]
            channels[run.indices("accelerometer", "x")] += 0.1 * floor / floor.std()
            runs.append(replace(run, channels=channels))
            true.append(0.1 * float(floor[-round(7.0 * run.rate_hz) :].std() / floor.std()))
        spectrum = prepare(runs)[0][0].floor
        assert spectrum is not None
        found.append(spectrum.total_m_s2 / float(np.sqrt(np.mean(np.square(true)))))
    assert np.mean(found) == pytest.approx(1.0, abs=0.03)


def test_a_weak_floor_is_a_cause_as_well(shaken: tuple[list[RockingRun], dict[str, float]]) -> None:
    runs, _ = shaken
    weak = []
    for run in runs:
        found = [replace(f, value=0.05) if f.key == "ambient@floor" else f for f in run.findings]
        weak.append(replace(run, findings=found))
    (finding,) = [f for f in findings_of(weak) if f.name == "ambient@floor"]
    assert finding.material


def test_what_it_does_to_the_motion_is_in_the_errors(
    shaken: tuple[list[RockingRun], dict[str, float]],
) -> None:
    """Without them the motion scatters by many errors, and the answer is something unknown."""
    runs, _ = shaken
    model, library = model_and_library(runs)
    others = [name for name in library if name not in ("viscous", "restitution_slope")]
    result = diagnose_prepared(model, runs, library.without(*others))

    assert result.rest.unknown < 0.5
    assert max(group.discrepancy for group in result.rest.groups) < 2.0


def test_times_and_peaks_alone_keep_what_the_floor_does(
    shaken: tuple[list[RockingRun], dict[str, float]],
) -> None:
    bare = [run.of_blocks(()) for run in shaken[0]]
    model, _ = model_and_library(bare)
    for run in bare:
        values = {p.name: p.value(0.0) for p in (*model.nuisance, *model.local_nuisance(run))}
        moved = model.predict(run, values).loadings[FLOOR]
        assert moved.shape[0] == len(run.features)
        assert np.any(moved[-run.peaks.size :])


def test_half_cycles_that_have_nothing_to_do_with_each_other_are_moved_independently(
    shaken: tuple[list[RockingRun], dict[str, float]],
) -> None:
    """A floor of a few hertz has forgotten its phase after a second or two, and it never comes back."""
    for run in shaken[0]:
        assert run.floor_loadings is not None
        moved = run.floor_loadings[-run.peaks.size :]
        moved /= np.linalg.norm(moved, axis=1, keepdims=True)
        at_s = run.swings.peak_s[run.peaks]
        apart = np.abs(at_s[:, None] - at_s) > 2.5
        assert np.count_nonzero(apart) > 20
        together = np.abs(moved @ moved.T)[apart]
        assert together.max() < 0.3


def test_a_quiet_floor_changes_nothing(tmp_path: Path) -> None:
    runs, _ = _case(tmp_path, "nothing")

    assert not any(f.name == "ambient@floor" for f in findings_of(runs))


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_two_knocks_with_next_to_nothing_between_them_are_no_floor() -> None:
    """A part of two samples tells no frequency, and must not spoil what the other parts tell."""
    runs = simulate({}, (0.25, -0.35, 0.3))
    for run in runs:
        step = round(run.rate_hz / GRID_HZ)
        apart = (round(KNOCK_S * GRID_HZ) + 2) * step
        first = (run.channels.shape[1] // step - 100) * step - apart
        chosen = run.indices("accelerometer")
        for at in (first, first + apart):
            run.channels[chosen, at : at + step // 2] += 5.0
    assert all(run.floor is None for run in prepare(runs)[0])

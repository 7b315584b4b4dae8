"""A floor that shakes at many frequencies is measured at rest, and its part in the motion is no effect."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from daq_app.gap.blind.making.make import Order, make_case
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.findings import findings_of
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ
from daq_app.gap.rocking_model.records import load_run
from daq_app.gap.rocking_model.study import diagnose_prepared, model_and_library, prepare
from daq_app.gap.rocking_model.tolerances.motion import KNOCK_S
from tests.support.simulated_wall import simulate

RIG = Path(__file__).parents[4] / "configs" / "fr1.toml"
SEED = 12


def _case(folder: Path, hidden: str) -> tuple[list[RockingRun], dict[str, float]]:
    """The runs of a case of an ordinary laboratory, and the parameters of what it hides."""
    text = RIG.read_text(encoding="utf-8")
    order = Order(SEED, folder / "out", folder / "kept", (text,), 3, None, "ordinary", "", hidden)
    name = make_case(order, 0)
    label = json.loads(json.loads((folder / "kept" / f"{name}.json").read_text(encoding="utf-8"))["label"])
    files = sorted((folder / "out" / name).glob("*.h5"))
    parameters = label["effects"][0]["parameters"] if label["effects"] else {}
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

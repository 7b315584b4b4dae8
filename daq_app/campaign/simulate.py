"""A whole campaign of simulated tests without real time, its truth kept beside the runs.

Every specimen has a true r; each test's r scatters about it, and so does its release, as the seed
decides.  The truth is written to ``truth.json`` and into no run: what analyses the runs cannot see it.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
import psutil

from daq_app.acquisition.course.tare import NotSteady
from daq_app.acquisition.session.offline import Readings, record_offline
from daq_app.campaign.plan import Campaign
from daq_app.campaign.summaries.of_run import read_and_summarise
from daq_app.config import ConfigError, Problem, Rig, TaskPlan, load_rig, plan_tasks
from daq_app.rocking.analysis.options import AnalysisOptions
from daq_app.runfile import RunFileError
from daq_app.runfile.durable import replace_durably, write_whole
from daq_app.runfile.folder import RUN_SUFFIX
from daq_app.workers import Workers, run_all
from sim_hardware.direct import synthesise_test

TRUTH_FILE: Final = "truth.json"
IMPACTS_A_TEST: Final = 25
"""Impacts that a test adds to what the wall has had, for effects that wear (Table of physics.md)."""

_WORKSHOP: Final = ".simulate-"
_AFTER_REST_S: Final = 2.0
"""Readings beyond the recording's own end, so that the detector of rest has something to see."""

Progress = Callable[[int, int, str], None]
"""Called with (done, total, name of the test just written)."""


@dataclass(frozen=True, slots=True)
class SpecimenTruth:
    """True restitution of one specimen."""

    r: float
    test_scatter: float
    """Relative standard deviation of r from test to test."""
    impact_scatter: float
    """Relative standard deviation of r from impact to impact."""


@dataclass(frozen=True, slots=True)
class CampaignTruth:
    """What a simulated campaign is made from."""

    specimens: Mapping[str, SpecimenTruth]
    seed: int
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class PlannedSimulation:
    """One test to simulate, and its truth."""

    rig: str
    """Path of the rig file."""
    test: str
    theta0_over_alpha: float
    r: float
    """Mean of r over the impacts of this test."""
    impact_scatter: float
    seed: int
    impacts_before: int
    effects: Mapping[str, Mapping[str, float]]


def simulate_campaign(
    campaign: Campaign,
    truth: CampaignTruth,
    out: Path,
    *,
    workers: Workers = None,
    progress: Progress | None = None,
) -> list[Path]:
    """Write one run for every planned test into `out`, and `truth.json` beside them.

    Runs that exist already are kept, so an interrupted campaign goes on where it stopped; a run
    appears only when it is whole. Raises `ConfigError` where the campaign names no rig for a specimen
    or `truth` has none, or where `out` holds a campaign with another truth.
    """
    tests = tests_of(campaign, truth)
    out.mkdir(parents=True, exist_ok=True)
    _keep_truth(out / TRUTH_FILE, _document(truth, tests))
    todo = [test for test in tests if not (out / f"{test.test}{RUN_SUFFIX}").exists()]
    kept = len(tests) - len(todo)

    def done(number: int, test: PlannedSimulation) -> None:
        if progress:
            progress(kept + number, len(tests), test.test)

    if isinstance(workers, str):  # other machines do not know where this process stands
        todo = [replace(test, rig=str(Path(test.rig).resolve())) for test in todo]
    with _workshop(out) as workshop:
        run_all(partial(write_test, workshop=workshop, out=out), todo, workers, done)
    return [out / f"{test.test}{RUN_SUFFIX}" for test in tests]


def tests_of(campaign: Campaign, truth: CampaignTruth) -> list[PlannedSimulation]:
    """What is to be simulated, in the order of the plan; r of each test scatters as the seed decides."""
    rng = np.random.default_rng(truth.seed)
    tests, impacts = [], dict.fromkeys(campaign.specimens, 0)
    for number, planned in enumerate(campaign.tests):
        specimen = planned.name.specimen
        rig, specimen_truth = campaign.rig_path(specimen), truth.specimens.get(specimen)
        if rig is None or specimen_truth is None:
            missing = "rig file" if rig is None else "true r"
            wrong = f"no {missing} is given for {specimen}"
            raise ConfigError(
                [Problem(campaign.name, f"rigs.{specimen}", wrong, "Name one for each specimen")]
            )
        tests.append(
            PlannedSimulation(
                rig=str(rig),
                test=str(planned.name),
                theta0_over_alpha=planned.theta0_over_alpha,
                r=float(specimen_truth.r * (1.0 + specimen_truth.test_scatter * rng.standard_normal())),
                impact_scatter=specimen_truth.impact_scatter,
                seed=truth.seed * 1000 + number,
                impacts_before=impacts[specimen],
                effects=truth.effects,
            )
        )
        impacts[specimen] += IMPACTS_A_TEST
    return tests


def readings_of(test: PlannedSimulation) -> tuple[Rig, TaskPlan, Readings]:
    """The rig of a test, its task plan, and what its channels read from the wall upright to rest."""
    rig = load_rig(Path(test.rig))
    simulation = rig.simulation.model_copy(update={"restitution_scatter": test.impact_scatter})
    rig = rig.model_copy(update={"simulation": simulation})
    plan = plan_tasks(rig, test.rig)
    made = synthesise_test(
        rig,
        plan,
        test.theta0_over_alpha,
        test.seed,
        restitution=test.r,
        effects=test.effects,
        impacts_before=test.impacts_before,
        post_rest_s=rig.acquisition.post_rest_s + _AFTER_REST_S,
    )
    return rig, plan, Readings(made.readings, "simulated")


def write_test(test: PlannedSimulation, workshop: Path, out: Path) -> None:
    """Simulate a test and save it in `out` with its analysis beside it; `workshop` holds it until then."""
    rig, plan, readings = readings_of(test)
    name = f"{test.test}{RUN_SUFFIX}"
    text = Path(test.rig).read_text(encoding="utf-8")
    try:
        record_offline(rig, text, plan, readings, workshop / name, test.test)
    except NotSteady as error:
        raise RunFileError(
            f"{test.test} cannot be recorded. {error}", advice="Choose another seed."
        ) from None
    replace_durably(workshop / name, out / name)
    # Kept beside the run, as the recorder does when a wall has come to rest.
    read_and_summarise(out / name, {}, AnalysisOptions())


@contextmanager
def _workshop(out: Path) -> Iterator[Path]:
    """A folder for what is not whole yet; those of simulations that were killed are removed."""
    for left in out.glob(f"{_WORKSHOP}*"):
        number = left.name.removeprefix(_WORKSHOP).partition("-")[0]
        if not (number.isdigit() and psutil.pid_exists(int(number))):
            shutil.rmtree(left, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix=f"{_WORKSHOP}{os.getpid()}-", dir=out) as name:
        yield Path(name)


def _keep_truth(path: Path, document: dict[str, object]) -> None:
    """Write the truth, or see that the one there is the same: runs of two truths must not be mixed."""
    text = json.dumps(document, indent=1)
    try:
        same = json.loads(path.read_text(encoding="utf-8")) == json.loads(text)
    except FileNotFoundError:
        write_whole(path, text)
        return
    except ValueError:
        same = False
    if not same:
        wrong = "the folder holds a simulated campaign with another seed, r, scatter or plan"
        raise ConfigError(
            [Problem(str(path), "the truth", wrong, "Choose another folder, or empty this one")]
        )


def _document(truth: CampaignTruth, tests: list[PlannedSimulation]) -> dict[str, object]:
    return {
        "seed": truth.seed,
        "specimens": {
            name: {
                "r": specimen_truth.r,
                "test_scatter": specimen_truth.test_scatter,
                "impact_scatter": specimen_truth.impact_scatter,
            }
            for name, specimen_truth in truth.specimens.items()
        },
        "effects": {name: dict(values) for name, values in truth.effects.items()},
        "tests": {test.test: {"r": test.r, "theta0_over_alpha": test.theta0_over_alpha} for test in tests},
    }

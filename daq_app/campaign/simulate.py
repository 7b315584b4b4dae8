"""A whole campaign of simulated tests without real time, its truth kept beside the runs.

Every specimen has a true r; each test's r scatters about it, and so does its release, as the seed
decides.  The truth is written to ``truth.json`` and into no run: what analyses the runs cannot see it.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Final

import numpy as np

from daq_app.acquisition.offline import Readings, record_offline
from daq_app.campaign.plan import Campaign
from daq_app.config import ConfigError, Problem, load_rig, plan_tasks
from sim_hardware.direct import synthesise_test

TRUTH_FILE: Final = "truth.json"
IMPACTS_A_TEST: Final = 25
"""Impacts that a test adds to what the wall has had, for effects that wear (Table of physics.md)."""

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
class _Job:
    rig: str
    test: str
    theta0_over_alpha: float
    r: float
    impact_scatter: float
    seed: int
    impacts_before: int
    effects: Mapping[str, Mapping[str, float]]
    out: str


def simulate_campaign(
    campaign: Campaign,
    truth: CampaignTruth,
    out: Path,
    *,
    workers: int | None = None,
    progress: Progress | None = None,
) -> list[Path]:
    """Write one run for every planned test into `out`, and `truth.json` beside them.

    Runs that exist already are kept, so an interrupted campaign goes on where it stopped. Raises
    `ConfigError` where the campaign names no rig for a specimen or `truth` has none.
    """
    jobs = _jobs(campaign, truth, out)
    out.mkdir(parents=True, exist_ok=True)
    (out / TRUTH_FILE).write_text(json.dumps(_document(truth, jobs), indent=1), encoding="utf-8")
    todo = [job for job in jobs if not Path(job.out).exists()]
    done = len(jobs) - len(todo)
    with ProcessPoolExecutor(workers or os.cpu_count() or 1, mp_context=get_context("spawn")) as pool:
        pending = {pool.submit(_run_job, job): job for job in todo}
        open_jobs = set(pending)
        try:
            while open_jobs:
                finished, open_jobs = wait(open_jobs, return_when=FIRST_COMPLETED)
                for future in finished:
                    future.result()
                    done += 1
                    if progress:
                        progress(done, len(jobs), pending[future].test)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [Path(job.out) for job in jobs]


def _jobs(campaign: Campaign, truth: CampaignTruth, out: Path) -> list[_Job]:
    rng = np.random.default_rng(truth.seed)
    jobs, impacts = [], dict.fromkeys(campaign.specimens, 0)
    for number, planned in enumerate(campaign.tests):
        specimen = planned.name.specimen
        rig, own = campaign.rig_path(specimen), truth.specimens.get(specimen)
        if rig is None or own is None:
            missing = "rig file" if rig is None else "true r"
            wrong = f"no {missing} is given for {specimen}"
            raise ConfigError(
                [Problem(campaign.name, f"rigs.{specimen}", wrong, "Name one for each specimen")]
            )
        jobs.append(
            _Job(
                rig=str(rig),
                test=str(planned.name),
                theta0_over_alpha=planned.theta0_over_alpha,
                r=float(own.r * (1.0 + own.test_scatter * rng.standard_normal())),
                impact_scatter=own.impact_scatter,
                seed=truth.seed * 1000 + number,
                impacts_before=impacts[specimen],
                effects=truth.effects,
                out=str(out / f"{planned.name}.h5"),
            )
        )
        impacts[specimen] += IMPACTS_A_TEST
    return jobs


def _document(truth: CampaignTruth, jobs: list[_Job]) -> dict[str, object]:
    return {
        "seed": truth.seed,
        "specimens": {
            name: {"r": own.r, "test_scatter": own.test_scatter, "impact_scatter": own.impact_scatter}
            for name, own in truth.specimens.items()
        },
        "effects": {name: dict(values) for name, values in truth.effects.items()},
        "tests": {job.test: {"r": job.r, "theta0_over_alpha": job.theta0_over_alpha} for job in jobs},
    }


def _run_job(job: _Job) -> None:
    rig = load_rig(Path(job.rig))
    simulation = rig.simulation.model_copy(update={"restitution_scatter": job.impact_scatter})
    rig = rig.model_copy(update={"simulation": simulation})
    plan = plan_tasks(rig, job.rig)
    made = synthesise_test(
        rig,
        plan,
        job.theta0_over_alpha,
        job.seed,
        restitution=job.r,
        effects=job.effects,
        impacts_before=job.impacts_before,
        post_rest_s=rig.acquisition.post_rest_s + _AFTER_REST_S,
    )
    text = Path(job.rig).read_text(encoding="utf-8")
    record_offline(rig, text, plan, Readings(made.readings, "simulated"), Path(job.out), job.test)

"""Processor time of one job of each kind that many machines share, and what a thousand runs cost with it."""

from __future__ import annotations

import math
import shutil
import statistics
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from benchmarks.support.effort import Effort
from benchmarks.support.figure import Figure
from daq_app.acquisition.closing.derive import derive_imported
from daq_app.campaign.plan import load_campaign
from daq_app.campaign.simulate import CampaignTruth, SpecimenTruth, tests_of, write_test
from daq_app.campaign.summaries.of_run import read_and_summarise
from daq_app.config import parse_rig
from daq_app.gap.many import Specimen, diagnose_one
from daq_app.rocking.analysis.options import AnalysisOptions
from daq_app.runfile.exporters import export_run
from daq_app.runfile.importers import import_file

_RIG = Path(__file__).parents[1] / "configs" / "fr1.toml"
_LEVELS = {"L1": 0.15, "L2": 0.25, "L3": 0.35, "L4": 0.40}
_TWO_LEVELS = {"L1": 0.15, "L3": 0.35}
_TESTS_A_LEVEL = 3
_REPEATS = 3
_RUNS = 1000


def figures(effort: Effort) -> list[Figure]:
    """One process with one thread; the first job of a kind, which loads its libraries, is left out."""
    repeats, left_out = effort.of((_REPEATS, 1), (1, 0))
    causes = effort.of(3, 1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        simulating = _simulate(folder, effort.of(_LEVELS, _TWO_LEVELS), effort.of(_TESTS_A_LEVEL, 1))
        runs = tuple(sorted(folder.glob("*.h5")))
        foreign, rig_text, out = (
            export_run(runs[0], folder, "npz", units="raw"),
            _RIG.read_text("utf-8"),
            folder / "in",
        )
        rig = parse_rig(rig_text, str(_RIG))

        def bring_in() -> None:
            shutil.rmtree(out, ignore_errors=True)
            out.mkdir()
            import_file(foreign, rig, rig_text, out, derive=derive_imported)

        options = AnalysisOptions(bias_runs=6)
        campaign = Specimen(folder, "FR1", runs, ())
        found = {
            "a test simulated and saved": (simulating, 1),
            "a file imported and judged": (_spent(bring_in, repeats, left_out), 1),
            "a run analysed, with bias": (
                _spent(lambda: read_and_summarise(runs[0], {}, options, use_kept=False), repeats, left_out),
                1,
            ),
            f"a specimen of {len(runs)} runs diagnosed": (
                _spent(lambda: diagnose_one(campaign, causes=causes), repeats, left_out),
                len(runs),
            ),
        }
    return [figure for name, (times, share) in found.items() for figure in _two(name, times, share)]


def _two(name: str, times: list[float], runs_a_job: int) -> list[Figure]:
    """The cost of a job, and of a thousand runs on one core."""
    job = statistics.median(times)
    jobs = math.ceil(_RUNS / runs_a_job)
    return [
        Figure(name, job, "s of one core", len(times)),
        Figure(f"{_RUNS} runs: {name}", jobs * job / 60.0, "min of one core", note=f"{jobs} jobs, computed"),
    ]


def _simulate(folder: Path, ratios: Mapping[str, float], tests_a_level: int) -> list[float]:
    series = [
        f'[[sequence]]\nspecimen = "FR1"\nlevel = "{level}"\ntests = {tests_a_level}\n' for level in ratios
    ]
    levels = "\n".join(f"{level} = {ratio}" for level, ratio in ratios.items())
    plan = folder / "plan.toml"
    plan.write_text(
        f'name = "jobs"\n[levels]\n{levels}\n[rigs]\nFR1 = "{_RIG.as_posix()}"\n{"".join(series)}', "utf-8"
    )
    truth = CampaignTruth({"FR1": SpecimenTruth(0.895, 0.0, 0.004)}, seed=1)
    workshop = folder / "workshop"
    workshop.mkdir()
    times = []
    for test in tests_of(load_campaign(plan), truth):
        started = time.process_time()
        write_test(test, workshop, folder)
        times.append(time.process_time() - started)
    return times[1:]


def _spent(job: Callable[[], object], repeats: int, left_out: int) -> list[float]:
    times = []
    for _ in range(left_out + repeats):
        started = time.process_time()
        job()
        times.append(time.process_time() - started)
    return times[left_out:]

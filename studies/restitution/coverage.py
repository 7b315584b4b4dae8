"""``python -m studies.restitution.coverage --seeds 20``: how often the report's 95 % interval holds r.

For each seed a whole campaign is simulated (every test of the plan through the simulated wall, its
sensors and converters, with the scatter of `campaign simulate`), analysed as `campaign report` does,
and its Table 4.1 made by the report's own code. Only the run files are left out: readings go from the
converters to the analysis in memory, zeroed over the first second as a recorded test is.

Every test's result is kept in a file of JSON lines, one line per seed: stop it at any time, the same
command goes on. Runs on all cores; a campaign takes about half a minute.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import sys
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy import stats

from daq_app.acquisition.course.tare import take_tare
from daq_app.campaign.names import TestName
from daq_app.campaign.plan import load_campaign
from daq_app.campaign.report.statistics import random_effects_mean
from daq_app.campaign.report.tables import METHODS, RestitutionRow, table_4_1
from daq_app.campaign.simulate import CampaignTruth, PlannedSimulation, SpecimenTruth, readings_of, tests_of
from daq_app.campaign.status import RecordedTest, TestVerdict
from daq_app.campaign.summaries.of_run import summarise
from daq_app.campaign.summaries.summary import MethodResult, TestSummary
from daq_app.config import Scaling, load_rig
from daq_app.rocking import AnalysisOptions, TestAnalysis, TestRecord, analyse_record
from daq_app.workers import process_pool

PLAN: Final = Path(__file__).parents[2] / "configs" / "campaigns" / "costa.toml"
TEST_SCATTER: Final = 0.005
IMPACT_SCATTER: Final = 0.004
"""The defaults of `campaign simulate`."""
BIAS_RUNS: Final = 6
"""The default of `campaign report`."""
_TARE_S: Final = 1.0
_THINNED: Final = np.empty(0)


Interval = tuple[float, float]


def analysed(test: PlannedSimulation) -> tuple[TestSummary, dict[str, Interval]]:
    """One test simulated and analysed as its run file would be, and the test's own 95 % intervals."""
    rig, plan, readings = readings_of(test)
    armed = round(_TARE_S * plan.rate_hz)
    tare = take_tare(rig, readings.values[:, :armed], 0)
    record = TestRecord.from_array(
        rig,
        plan.rate_hz,
        Scaling.of(rig.channels, tare.readings).to_si(readings.values[:, armed:]),
        first_sample=armed,
        time_offsets_s={c.channel.id: c.time_offset_s for task in plan.tasks for c in task.channels},
        label=test.test,
    )
    name = TestName.parse(test.test)
    analysis = analyse_record(record, AnalysisOptions(bias_runs=BIAS_RUNS))
    if not analysis.found:
        raise RuntimeError(f"{test.test}, seed {test.seed}: {[note.text for note in analysis.notes]}")
    recorded = RecordedTest(name, TestVerdict.GOOD, 0, Path(f"{test.test}.h5"))
    summary = summarise(recorded, rig, analysis)
    thin = replace(summary, time_s=_THINNED, rotation_rad=_THINNED, velocity_rad_s=_THINNED)
    return thin, _intervals(analysis)


def _intervals(analysis: TestAnalysis) -> dict[str, Interval]:
    """As `daq-app analyse` prints them, less the method's bias."""
    found = {"CRT": analysis.estimates["crt"].interval95(), "EAV": analysis.estimates["eav"].interval95()}
    if analysis.fit is not None:
        found["fit"] = analysis.fit.interval95()
    bias = {name: analysis.bias[name.lower()].mean for name in found}
    return {name: (i[0] - bias[name], i[1] - bias[name]) for name, i in found.items() if i is not None}


def campaign_of(seed: int, pool: Executor) -> dict[str, Any]:
    """Every test of one seed, as plain data."""
    campaign = load_campaign(PLAN)
    truth = CampaignTruth(
        {
            name: SpecimenTruth(_true_r(campaign.rig_path(name)), TEST_SCATTER, IMPACT_SCATTER)
            for name in campaign.specimens
        },
        seed,
    )
    tests = tests_of(campaign, truth)
    answers = list(pool.map(analysed, tests))
    return {
        "seed": seed,
        "true_r": {name: own.r for name, own in truth.specimens.items()},
        "tests": [
            {
                "test": summary.test,
                "true_r": test.r,
                "r_max": summary.r_max,
                "phi0": summary.phi0,
                "methods": {name: asdict(replace(m, points=())) for name, m in summary.methods.items()},
                "intervals": intervals,
            }
            for test, (summary, intervals) in zip(tests, answers, strict=True)
        ],
    }


def _true_r(rig: Path | None) -> float:
    assert rig is not None, "the shipped plan names a rig for each specimen"
    return load_rig(rig).simulation.restitution


def rows_of(result: dict[str, Any]) -> list[RestitutionRow]:
    """Table 4.1 of one seed, by the report's own code."""
    return table_4_1([_summary(entry) for entry in result["tests"]])


def _summary(entry: dict[str, Any]) -> TestSummary:
    """What Table 4.1 needs of a test; the rest is not kept."""
    name = TestName.parse(entry["test"])
    return TestSummary(
        test=entry["test"],
        specimen=name.specimen,
        level=name.level,
        repetition=name.repetition,
        run="",
        alpha_rad=math.nan,
        p_rad_s=math.nan,
        r_max=entry["r_max"],
        theta0_rad=math.nan,
        impacts_s=(),
        peaks_rad=(),
        periods_s=(),
        methods={key: MethodResult(**{**value, "points": ()}) for key, value in entry["methods"].items()},
        time_s=_THINNED,
        rotation_rad=_THINNED,
        velocity_rad_s=_THINNED,
        good=True,
    )


def from_true_values(result: dict[str, Any], specimen: str) -> bool:
    """Whether Student's interval of the tests' true r holds the specimen's: what perfect tests would give."""
    entries = [e for e in result["tests"] if TestName.parse(e["test"]).specimen == specimen]
    values = np.array([entry["true_r"] for entry in entries])
    reach = stats.t.ppf(0.975, values.size - 1) * values.std(ddof=1) / math.sqrt(values.size)
    return bool(abs(values.mean() - result["true_r"][specimen]) <= reach)


def summary_table(results: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """By specimen and estimator: seeds covered, mean error, mean half width, worst miss."""
    found: dict[tuple[str, str], list[tuple[float, float, float]]] = {}
    for result in results:
        for row in rows_of(result):
            true, group = result["true_r"][row.specimen], row.corrected
            reach = (group.high95 - group.low95) / 2.0
            found.setdefault((row.specimen, row.method), []).append((group.mean - true, reach, true))
    table = []
    for (specimen, method), values in sorted(
        found.items(), key=lambda item: (item[0][0], METHODS.index(item[0][1]))
    ):
        errors, reaches, true = (np.array(column) for column in zip(*values, strict=True))
        table.append(
            {
                "specimen": specimen,
                "method": method,
                "true_r": float(true[0]),
                "seeds": len(values),
                "covered": int(np.count_nonzero(np.abs(errors) <= reaches)),
                "covered_by_perfect_tests": sum(from_true_values(result, specimen) for result in results),
                "mean_error": float(errors.mean()),
                "mean_half_width": float(reaches.mean()),
                "worst_error_over_half_width": float(np.max(np.abs(errors) / reaches)),
            }
        )
    return table


def resampled(results: Sequence[dict[str, Any]], campaigns: int) -> list[dict[str, Any]]:
    """Coverage over many campaigns made of the simulated tests' errors: what 20 seeds are too few to show.

    Each new campaign draws its tests' true r afresh; error and standard error of each test are those of a
    simulated test of the same specimen and level. The mean and its interval are the report's own.
    """
    pools: dict[tuple[str, str, str], list[tuple[float, float]]] = {}
    for result in results:
        for entry in result["tests"]:
            name = TestName.parse(entry["test"])
            for method, value in entry["methods"].items():
                error = value["r"] - value["bias"] - entry["true_r"]
                sigma = math.hypot(value["standard_error"], value["bias_standard_error"])
                pools.setdefault((name.specimen, method, name.level), []).append((error, sigma))
    rng = np.random.default_rng(0)
    table = []
    for specimen, true_r in results[0]["true_r"].items():
        names = [TestName.parse(entry["test"]) for entry in results[0]["tests"]]
        levels = [name.level for name in names if name.specimen == specimen]
        for method in METHODS:
            covered = 0
            for _ in range(campaigns):
                drawn = true_r * (1.0 + TEST_SCATTER * rng.standard_normal(len(levels)))
                picks = [pools[specimen, method, level] for level in levels]
                errors = np.array([pool[rng.integers(len(pool))] for pool in picks])
                group = random_effects_mean((drawn + errors[:, 0]).tolist(), errors[:, 1].tolist())
                covered += group.low95 <= true_r <= group.high95
            table.append(
                {
                    "specimen": specimen,
                    "method": method,
                    "campaigns": campaigns,
                    "covered_share": covered / campaigns,
                    "standard_error": math.sqrt(0.95 * 0.05 / campaigns),
                }
            )
    return table


def single_tests(results: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """By estimator and level: bias, error and standard error of single tests against their own true r."""
    found: dict[tuple[str, str], list[tuple[float, float, float]]] = {}
    for result in results:
        for entry in result["tests"]:
            level = TestName.parse(entry["test"]).level
            for method, value in entry["methods"].items():
                error = value["r"] - value["bias"] - entry["true_r"]
                sigma = math.hypot(value["standard_error"], value["bias_standard_error"])
                # Stores of earlier versions have no intervals of single tests: NaN.
                low, high = entry.get("intervals", {}).get(method, (math.nan, math.nan))
                inside = math.nan if math.isnan(low) else float(low <= entry["true_r"] <= high)
                found.setdefault((method, level), []).append((error, sigma, inside))
    table = []
    for (method, level), pairs in sorted(
        found.items(), key=lambda item: (METHODS.index(item[0][0]), item[0][1])
    ):
        errors, sigmas, covered = np.array(pairs).T
        table.append(
            {
                "method": method,
                "level": level,
                "tests": errors.size,
                "covered_share": float(covered.mean()),
                "mean_error": float(errors.mean()),
                "rms_error": float(np.sqrt(np.mean(errors**2))),
                "rms_of_error_over_standard_error": float(np.sqrt(np.mean((errors / sigmas) ** 2))),
            }
        )
    return table


def _print(console: Console, title: str, rows: list[dict[str, Any]]) -> None:
    table = Table(title=title, title_justify="left")
    for name in rows[0]:
        text = name in ("specimen", "method", "level")
        table.add_column(name.replace("_", " "), justify="left" if text else "right")
    for row in rows:
        table.add_row(*(f"{v:.5f}" if isinstance(v, float) else str(v) for v in row.values()))
    console.print(table)


def _read(path: Path) -> dict[int, dict[str, Any]]:
    if not path.exists():
        return {}
    results = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            result = json.loads(line)
        except ValueError:
            continue  # the last line of a run that was killed
        results[result["seed"]] = result
    return results


def main() -> int:
    """Do what is missing, print coverage, write JSON; 1 where an estimator misses 19 of 20."""
    parser = argparse.ArgumentParser(prog="python -m studies.restitution.coverage", description=__doc__)
    parser.add_argument("--seeds", type=int, default=20, help="how many campaigns")
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--resampled", type=int, default=2000, help="campaigns of resampled tests; 0: none")
    parser.add_argument("--workers", type=int, default=None, help="processes; all cores if left out")
    parser.add_argument("--store", type=Path, default=Path("coverage.jsonl"), help="results of single tests")
    parser.add_argument("--json", type=Path, default=Path("coverage.json"), help="where to write the tables")
    options = parser.parse_args()
    wanted = range(options.first_seed, options.first_seed + options.seeds)
    done = _read(options.store)
    todo = [seed for seed in wanted if seed not in done]
    console = Console(width=None if sys.stdout.isatty() else 140)
    if todo:
        with process_pool(options.workers) as pool:
            for seed in todo:
                started = time.perf_counter()
                done[seed] = campaign_of(seed, pool)
                with options.store.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(done[seed]) + "\n")
                console.print(f"seed {seed}: {time.perf_counter() - started:.0f} s")
    results = [done[seed] for seed in wanted]
    coverage = summary_table(results)
    singles = single_tests(results)
    _print(
        console, f"True r within the report's own 95 % interval, seeds {wanted[0]} to {wanted[-1]}", coverage
    )
    _print(console, "Single tests against their own r", singles)
    many = resampled(results, options.resampled) if options.resampled else []
    if many:
        _print(console, "Campaigns of resampled tests", many)
    document = {
        "machine": {"platform": platform.platform(), "python": platform.python_version()},
        "measured": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "plan": PLAN.name,
        "test_scatter": TEST_SCATTER,
        "impact_scatter": IMPACT_SCATTER,
        "seeds": list(wanted),
        "coverage": coverage,
        "single_tests": singles,
        "resampled": many,
    }
    options.json.write_text(json.dumps(document, indent=1), encoding="utf-8")
    console.print(f"written to {options.json}")
    return 0 if all(row["covered"] >= 0.95 * row["seeds"] for row in coverage) else 1


if __name__ == "__main__":
    sys.exit(main())

"""``python -m studies.restitution faults --tests 20`` and ``coverage --tests 200``.

`faults`: error of r by each method under each fault, how far the verdict trusts it, and what was said.
`coverage`: how often each stated interval holds the truth on sound tests, and how many are warned falsely.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from daq_app.config import Rig, load_rig
from daq_app.rocking import AnalysisOptions, TestAnalysis, analyse_record
from studies.restitution.faults import FAULTS, Fault
from studies.restitution.laboratory import LaboratoryTest, draw_test

RIG = Path(__file__).parents[2] / "configs" / "fr1.toml"
_OPTIONS = AnalysisOptions(bias_runs=0, keep_series=False)
_OFF_R, _OFF_SIGMAS = 0.002, 2.0
"""An r by any method is wrong beyond the first, and doubtful beyond so many standard errors of the verdict,
as one sound test in twenty is."""
_CYCLES = 7
"""Half-cycles of each test whose peaks, speeds and times are looked at."""


def fault_row(fault: Fault, tests: Sequence[LaboratoryTest]) -> str:
    """One line of the table of faults; a wrong and a doubtful r of which nothing was said are counted."""
    errors, trusts, said = [], Counter[str](), Counter[str]()
    wrong, doubtful = 0, 0
    for test in tests:
        analysis = analyse_record(fault.record(test), _OPTIONS)
        for finding in analysis.findings:
            if finding.severity == "warning":
                said[" ".join([*finding.channels[:1], finding.family, finding.kind])] += 1
        if not analysis.found:
            said["no test found"] += 1
            continue
        trusts[analysis.verdict.trust] += 1
        found = [analysis.estimates["eav"].r, analysis.estimates["crt"].r, analysis.verdict.r]
        found.append(None if analysis.fit is None else analysis.fit.r)
        errors.append([math.nan if r is None else r - test.truth["restitution"] for r in found])
        off = float(np.nanmax(np.abs(errors[-1])))
        quiet = analysis.verdict.trust == "good"
        wrong += quiet and off > _OFF_R
        doubtful += quiet and off > _OFF_SIGMAS * (analysis.verdict.standard_error or 0.0)
    largest = np.nanmax(np.abs(errors), axis=0) if errors else np.full(4, np.nan)
    what = f"{fault.family}{'' if fault.single is None else f' {fault.single}'} {fault.kind} {fault.size:g}"
    numbers = " ".join(f"{value:8.4f}" for value in largest)
    return f"{what:28s} {numbers} {wrong:6d} {doubtful:8d}  {dict(trusts)}  {dict(said)}"


def deviations(test: LaboratoryTest, analysis: TestAnalysis) -> list[tuple[str, float]]:
    """(quantity, error over its standard uncertainty) of one sound test."""
    truth, found = test.truth, []

    def add(name: str, error: float, sigma: float | None) -> None:
        if sigma and math.isfinite(error) and math.isfinite(sigma):
            found.append((name, error / sigma))

    for name, value in analysis.theta0_by_family.items():
        add(f"θ0 {name}", value.value - truth["theta0_rad"], value.sigma)
    if analysis.fit is not None:
        add("α (fit)", analysis.fit.alpha_rad - truth["alpha_rad"], analysis.fit.sigma_alpha_rad)
        add("p (fit)", analysis.fit.p_rad_s - truth["p_rad_s"], analysis.fit.sigma_p_rad_s)
    times, peak_times = np.array(truth["impact_time_s"]), np.array(truth["peak_time_s"])
    for cycle in analysis.half_cycles[1 : 1 + _CYCLES]:
        before = cycle.speed_before_rad_s - truth["velocity_before_rad_s"][cycle.n - 1]
        after = cycle.speed_after_rad_s - truth["velocity_after_rad_s"][cycle.n - 1]
        add("speed before", before, cycle.sigma_speed_before_rad_s)
        add("speed after", after, cycle.sigma_speed_after_rad_s)
        add("impact time", cycle.start_s - times[cycle.n - 1], cycle.sigma_start_s)
        if math.isfinite(cycle.duration_s) and cycle.n < times.size:
            true_s = times[cycle.n] - times[cycle.n - 1]
            add("half-cycle", cycle.duration_s - true_s, cycle.sigma_duration_s)
            place = int(np.argmin(np.abs(peak_times - cycle.start_s - cycle.duration_s / 2.0)))
            add("peak", cycle.peak_rad - truth["peak_rotation_rad"][place], cycle.sigma_peak_rad)
    return found


def coverage(rig: Rig, seeds: range) -> list[str]:
    """Lines of the table of intervals."""
    inside: dict[str, list[bool]] = {}
    warned, lost = 0, 0
    for seed in seeds:
        test = draw_test(rig, seed)
        analysis = analyse_record(test.record(), _OPTIONS)
        if not analysis.found:
            lost += 1
            continue
        warned += analysis.verdict.trust != "good"
        r = test.truth["restitution"]
        intervals = {name: analysis.estimates[name].interval95() for name in ("eav", "crt")}
        intervals["verdict"] = analysis.verdict.interval95
        intervals["fit"] = None if analysis.fit is None else analysis.fit.interval95()
        for name, interval in intervals.items():
            if interval is not None:
                inside.setdefault(f"r {name}", []).append(interval[0] <= r <= interval[1])
        for name, ratio in deviations(test, analysis):
            inside.setdefault(name, []).append(abs(ratio) <= 1.96)
    lines = [f"{name:20s} {np.mean(held):6.1%} of {len(held)}" for name, held in inside.items()]
    return [*lines, f"{warned} of {len(seeds) - lost} sound tests are not called good; {lost} not found"]


def main() -> None:
    """Print the table that was asked for."""
    parser = argparse.ArgumentParser(prog="python -m studies.restitution", description=__doc__)
    parser.add_argument("table", choices=["faults", "coverage"])
    parser.add_argument("--tests", type=int, default=20, help="simulated tests, for each fault or in all")
    parser.add_argument("--first-seed", type=int, default=5000)
    options = parser.parse_args()
    rig = load_rig(RIG)
    seeds = range(options.first_seed, options.first_seed + options.tests)
    if options.table == "coverage":
        print("\n".join(coverage(rig, seeds)))
        return
    tests = [draw_test(rig, seed) for seed in seeds]
    print("largest |error| of r:             EAV      CRT  verdict      fit  wrong doubtful  trust, said")
    for fault in FAULTS:
        print(fault_row(fault, tests), flush=True)


if __name__ == "__main__":
    main()

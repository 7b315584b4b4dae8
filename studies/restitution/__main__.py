"""``python -m studies.restitution faults --tests 20``, ``walls --tests 5`` and ``coverage --tests 200``.

`walls`: the same for what walls do that a rigid block with one r does not.
`sensors`: the same for the other effects on sensors that the simulator knows.
`faults`: error of r by each method under each fault, how far the verdict trusts it, and what was said.
`coverage`: how often each stated interval holds the truth on sound tests, and how many are warned falsely.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from daq_app.config import load_rig
from daq_app.rocking import AnalysisOptions, TestAnalysis, TestRecord, analyse_record
from studies.restitution.faults import FAULTS, Fault
from studies.restitution.foreign import foreign_tests
from studies.restitution.laboratory import LaboratoryTest, draw_test
from studies.restitution.sensors import SENSORS
from studies.restitution.walls import WALLS, SimulatedEffect, mean_r_of_impacts, ringing_test

RIG = Path(__file__).parents[2] / "configs" / "fr1.toml"
_OPTIONS = AnalysisOptions(bias_runs=0, keep_series=False)
_OFF_R, _OFF_SIGMAS = 0.002, 2.0
"""What a fault may move r by, by any method, and the verdict in standard errors, with nothing said. The
scatter of r between impacts, which sound tests have as well, is no fault: the same test is compared."""
_REACH, _MEDIAN = 1.96, 0.6745
"""Of a normal error, in standard deviations: what 95 % and what half of its sizes are below."""
_CYCLES = 7
"""Half-cycles of each test whose peaks, speeds and times are looked at."""


_METHODS = ("EAV", "CRT", "verdict", "fit")
_EFFECTS = {"walls": WALLS[1:], "sensors": SENSORS}


@dataclass(frozen=True, slots=True)
class Answer:
    """What the analysis of one recording says of r."""

    errors: tuple[float, ...]
    """Of r by each of `_METHODS`; NaN where it gives none."""
    standard_error: float
    """Of the verdict."""
    trust: str
    all_hold: bool
    """Whether the interval of each of `_METHODS` holds the truth."""
    said: tuple[str, ...]
    """First channel, family and kind of each warning; what is told of the wall without one is in brackets."""


def answer_of(record: TestRecord, true_r: float) -> Answer:
    """Analyse one recording."""
    analysis = analyse_record(record, _OPTIONS)
    said = tuple(
        " ".join([*finding.channels[:1], finding.family, finding.kind])
        if finding.severity == "warning"
        else f"({finding.family} {finding.kind})"
        for finding in analysis.findings
        if finding.severity == "warning" or finding.family == "wall"
    )
    if not analysis.found:
        return Answer((math.nan,) * len(_METHODS), math.nan, "not found", False, said)
    values = [analysis.estimates["eav"].r, analysis.estimates["crt"].r, analysis.verdict.r]
    values.append(None if analysis.fit is None else analysis.fit.r)
    errors = tuple(math.nan if r is None else r - true_r for r in values)
    intervals = intervals_of(analysis).values()
    all_hold = all(i is None or i[0] <= true_r <= i[1] for i in intervals)
    verdict = analysis.verdict
    return Answer(errors, verdict.standard_error or math.nan, verdict.trust, all_hold, said)


def intervals_of(analysis: TestAnalysis) -> dict[str, tuple[float, float] | None]:
    """The 95 % interval of r by each method and of the verdict; None where there is none."""
    fit = None if analysis.fit is None else analysis.fit.interval95()
    methods = {name: analysis.estimates[name].interval95() for name in ("eav", "crt")}
    return {**methods, "verdict": analysis.verdict.interval95, "fit": fit}


def row_of(what: str, answers: Sequence[Answer], sound: Sequence[Answer]) -> str:
    """One line of the table of faults or walls, beside what the same tests say as sound ones (`sound`).

    Counted as quiet are tests that are called good although what was put in moves r: by any method by more
    than `_OFF_R`, or the verdict by more than `_OFF_SIGMAS` of the sound test's standard errors. Counted
    as missed are those of them whose own interval of r does not hold the truth either. Behind the largest
    error by each method stands that of the verdict in tests that are not called doubtful.
    """
    quiet = missed = 0
    for answer, before in zip(answers, sound, strict=True):
        moved = np.abs(np.subtract(answer.errors, before.errors))
        doubtful = moved[_METHODS.index("verdict")] > _OFF_SIGMAS * before.standard_error
        said_nothing = answer.trust == "good" and bool(np.nanmax(moved) > _OFF_R or doubtful)
        quiet += said_nothing
        missed += said_nothing and not answer.all_hold
    table = np.array([answer.errors for answer in answers])
    numbers = " ".join(f"{value:8.4f}" for value in np.nanmax(np.abs(table), axis=0, initial=0.0))
    trusted = [abs(a.errors[_METHODS.index("verdict")]) for a in answers if a.trust in ("good", "remarks")]
    numbers += f" {max(trusted, default=math.nan):8.4f}"
    trusts = Counter(answer.trust for answer in answers)
    said = Counter(what for answer in answers for what in answer.said)
    return f"{what:28s} {numbers} {quiet:6d} {missed:6d}  {dict(trusts)}  {dict(said)}"


def fault_row(fault: Fault, tests: Sequence[LaboratoryTest], sound: Sequence[Answer]) -> str:
    """The line of a fault that is put into tests."""
    answers = [answer_of(fault.record(test), test.truth["restitution"]) for test in tests]
    single = "" if fault.single is None else f" {fault.single}"
    return row_of(f"{fault.family}{single} {fault.kind} {fault.size:g}", answers, sound)


def effect_row(effect: SimulatedEffect, seeds: Sequence[int], sound: Mapping[bool, Sequence[Answer]]) -> str:
    """The line of an effect in laboratories of `seeds`; `sound` by whether r is that of a test's impacts."""
    own = effect.changes_r
    return row_of(effect.name, [effect_answer(effect, seed, own_impacts=own) for seed in seeds], sound[own])


def effect_answer(effect: SimulatedEffect, seed: int, *, own_impacts: bool) -> Answer:
    """What the analysis says of an effect in the laboratory of `seed`."""
    test = effect.test(load_rig(RIG), seed)
    true_r = mean_r_of_impacts(test) if own_impacts else float(test.truth["restitution"])
    return answer_of(test.record(), true_r)


def deviations(test: LaboratoryTest, analysis: TestAnalysis) -> list[tuple[str, float]]:
    """(quantity, error over its standard uncertainty) of one sound test, as far as its truth is known."""
    truth, found = test.truth, []

    def add(name: str, error: float, sigma: float | None) -> None:
        if sigma and math.isfinite(error) and math.isfinite(sigma):
            found.append((name, error / sigma))

    for name, value in analysis.theta0_by_family.items():
        add(f"θ0 {name}", value.value - truth["theta0_rad"], value.sigma)
    if analysis.fit is not None and "alpha_rad" in truth:
        add("α (fit)", analysis.fit.alpha_rad - truth["alpha_rad"], analysis.fit.sigma_alpha_rad)
        add("p (fit)", analysis.fit.p_rad_s - truth["p_rad_s"], analysis.fit.sigma_p_rad_s)
    if "impact_time_s" not in truth:
        return found
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


def coverage(tests: Iterable[LaboratoryTest]) -> list[str]:
    """Lines of the table of intervals: of all tests, and of those that are not called doubtful.

    Behind them rms, median and 95 % quantile of the errors' sizes in all tests, over those of normal errors
    that are as large as stated.
    """
    inside: dict[str, list[tuple[float, bool]]] = {}
    analysed, warned, lost = 0, 0, 0
    for test in tests:
        analysis = analyse_record(test.record(), _OPTIONS)
        if not analysis.found:
            lost += 1
            continue
        analysed += 1
        trusted = analysis.verdict.trust != "doubtful"
        warned += analysis.verdict.trust != "good"
        r = test.truth["restitution"]
        intervals = intervals_of(analysis)
        reached = [
            (f"r {name}", (i[0] + i[1] - 2.0 * r) / (i[1] - i[0]))
            for name, i in intervals.items()
            if i is not None and math.isfinite(r)
        ]
        reached += [(name, ratio / _REACH) for name, ratio in deviations(test, analysis)]
        for name, error in reached:
            inside.setdefault(name, []).append((abs(error), trusted))
    lines = [f"{'':20s} all tests         not doubtful      rms    median 95 %"]
    for name, pairs in inside.items():
        errors, sure = np.array([error for error, _ in pairs]), [error for error, known in pairs if known]
        share = f"{np.mean(np.array(sure) <= 1.0):6.1%} of {len(sure)}" if sure else ""
        rms, median, most = np.sqrt(np.mean(errors**2)), np.median(errors), np.quantile(errors, 0.95)
        sizes = f"{_REACH * rms:6.2f} {_REACH / _MEDIAN * median:6.2f} {most:6.2f}"
        lines.append(f"{name:20s} {np.mean(errors <= 1.0):6.1%} of {len(pairs):<6d} {share:17s} {sizes}")
    return [*lines, f"{warned} of {analysed} tests are not called good; {lost} not found"]


def main() -> None:
    """Print the table that was asked for."""
    parser = argparse.ArgumentParser(prog="python -m studies.restitution", description=__doc__)
    parser.add_argument("table", choices=["faults", "walls", "sensors", "coverage"])
    parser.add_argument("--tests", type=int, default=20, help="simulated tests, for each fault or in all")
    parser.add_argument("--first-seed", type=int, default=5000)
    parser.add_argument(
        "--level", type=float, help="θ0 over α of simulated faults and coverage; drawn if left out"
    )
    parser.add_argument("--foreign", type=Path, help="folder of labelled recordings instead")
    parser.add_argument("--cases", nargs="*", default=(), help="cases of that folder; all if none is named")
    parser.add_argument("--ringing", action="store_true", help="simulated walls bend, recordings are cut")
    parser.add_argument("--impacts", type=int, help="after how many impacts simulated recordings end")
    kinds = sorted({fault.kind for fault in FAULTS})
    parser.add_argument("--kinds", nargs="*", choices=kinds, default=kinds, help="kinds of fault to put in")
    options = parser.parse_args()
    if options.level is not None and (
        options.table in _EFFECTS or options.foreign is not None or options.ringing
    ):
        parser.error("--level goes with simulated faults and coverage, without --foreign and --ringing")
    tests: Iterable[LaboratoryTest]
    if options.foreign is None:
        rig = load_rig(RIG)
        draw = ringing_test if options.ringing else partial(draw_test, level=options.level)
        tests = (draw(rig, options.first_seed + place) for place in range(options.tests))
        if options.impacts is not None:
            tests = (test.until_impact(options.impacts) for test in tests)
    else:
        tests = foreign_tests(options.foreign, RIG.parent, tuple(options.cases))
    if options.table == "coverage":
        print("\n".join(coverage(tests)))
        return
    methods = " ".join(f"{name:>8s}" for name in _METHODS)
    head = f"largest |error| of r:       {methods}  trusted  quiet missed  trust, said"
    if options.table in _EFFECTS:
        seeds = range(options.first_seed, options.first_seed + options.tests)
        rigid = {
            own: [effect_answer(WALLS[0], seed, own_impacts=own) for seed in seeds] for own in (False, True)
        }
        print(head)
        for effect in (WALLS[0], *_EFFECTS[options.table]):
            print(effect_row(effect, seeds, rigid), flush=True)
        return
    tests = list(tests)
    sound = [answer_of(test.record(), test.truth["restitution"]) for test in tests]
    print(head)
    for fault in (fault for fault in FAULTS if fault.kind in options.kinds):
        print(fault_row(fault, tests, sound), flush=True)


if __name__ == "__main__":
    main()

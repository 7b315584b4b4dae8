"""``python -m studies.restitution.yielding --tests 60``: intervals where edges are sharp, and yield.

With ``--drawn-mm 0 6`` each wall has a strip of its own, as wide as any between the two.

The walls of drawn laboratories stand on points that press and give way (`contact_strip`), along a strip of
each width at either edge; a width of 0 is an edge that is sharp and yields downwards only. What an edge is
stiff by is drawn. The table has, for each width, how often the 95 % intervals of the analysis hold the body's
α and p, those of sharp edges, r of the impacts and θ0.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from daq_app.config import load_rig
from daq_app.rocking import AnalysisOptions, TestAnalysis, analyse_record
from daq_app.workers import process_pool
from studies.restitution.contact_strip import contact_motion, stiffness_of
from studies.restitution.laboratory import LaboratoryTest, draw_test

RIG: Final = Path(__file__).parents[2] / "configs" / "fr1.toml"
WIDTHS_M: Final = (0.0, 0.001, 0.003, 0.006)
_LIFT_RAD: Final = 0.0045
"""Median rotation at which a strip of 3 mm would lift at its inner end. Edges are as stiff as that strip,
whatever their width: the wall bounces on them at 190 Hz."""
_LIFT_FACTOR: Final = 2.0
"""It is drawn lognormally, two of three within this factor of the median."""
_SLOWEST_RAD_S: Final = 0.05
"""r is that of faster impacts: slower ones lose more on contacts that give way."""
_OPTIONS: Final = AnalysisOptions(bias_runs=0, keep_series=False)


@dataclass(frozen=True, slots=True)
class Outcome:
    """Errors over stated standard errors, by quantity; NaN where no error is stated."""

    ratios: dict[str, float]
    stated: dict[str, float]
    """Relative standard errors of p and α, and that of the inset, m."""
    inset_m: float
    trust: str
    said: tuple[str, ...]
    """Kinds of the warnings."""


def strip_test(seed: int, width_m: float) -> LaboratoryTest:
    """The laboratory of `seed` with a wall on strips of this width."""
    drawn = np.random.default_rng([seed, 5]).standard_normal()
    stiffness = stiffness_of(0.003, _LIFT_RAD * _LIFT_FACTOR**drawn)
    engine = partial(contact_motion, width_m=width_m, stiffness_1_s2=stiffness)
    test = draw_test(load_rig(RIG), seed, engine=engine)
    before = np.abs(test.truth["velocity_before_rad_s"])
    after = np.abs(test.truth["velocity_after_rad_s"])
    test.truth["restitution"] = float(np.mean((after / before)[before > _SLOWEST_RAD_S]))
    return test


def outcome_of(test: LaboratoryTest) -> Outcome:
    """What the analysis states of one test, against its truth; `ValueError` where it finds none."""
    analysis = analyse_record(test.record(), _OPTIONS)
    if not analysis.found or analysis.fit is None:
        raise ValueError("no test is found in the recording")
    fit, truth = analysis.fit, test.truth
    best = analysis.theta0_by_family["best"]
    ratios = {
        "p": (fit.p_rad_s - truth["p_rad_s"]) / fit.sigma_p_rad_s,
        "α": (fit.alpha_rad - truth["alpha_rad"]) / fit.sigma_alpha_rad,
        "θ0": (best.value - truth["theta0_rad"]) / best.sigma,
        **_of_r(analysis, truth["restitution"]),
    }
    r0_m = test.rig.specimen.r0_m
    stated = {
        "p": fit.sigma_p_rad_s / fit.p_rad_s,
        "α": fit.sigma_alpha_rad / fit.alpha_rad,
        "inset": fit.sigma_inset_rad * r0_m,
    }
    said = tuple(finding.kind for finding in analysis.findings if finding.severity == "warning")
    return Outcome(ratios, stated, fit.inset_rad * r0_m, analysis.verdict.trust, said)


def _of_r(analysis: TestAnalysis, true_r: float) -> dict[str, float]:
    """Errors of r over half its interval, of 1.96 standard errors where that is normal."""
    intervals = {"r fit": analysis.fit and analysis.fit.interval95(), "r": analysis.verdict.interval95}
    return {
        name: 1.96 * (i[0] + i[1] - 2.0 * true_r) / (i[1] - i[0]) if i else math.nan
        for name, i in intervals.items()
    }


def line_of(widths: str, outcomes: Sequence[Outcome]) -> str:
    """Shares that hold, rms of errors over the stated ones, stated errors, and what was said."""
    parts = [f"{widths:>6s} mm"]
    for name in outcomes[0].ratios:
        ratios = np.array([outcome.ratios[name] for outcome in outcomes])
        ratios = ratios[np.isfinite(ratios)]
        share = f"{np.mean(np.abs(ratios) <= 1.96):6.1%} of {ratios.size:3d}"
        parts.append(f"{name}: {share}, rms {np.sqrt(np.mean(ratios**2)):4.2f}")
    medians = {name: np.nanmedian([o.stated[name] for o in outcomes]) for name in outcomes[0].stated}
    parts.append(f"stated p {medians['p']:.2%}, α {medians['α']:.2%}")
    inset = np.median([outcome.inset_m for outcome in outcomes])
    parts.append(f"inset {inset * 1e3:.2f} ± {medians['inset'] * 1e3:.2f} mm")
    trusts = sorted({outcome.trust for outcome in outcomes})
    parts.append(", ".join(f"{sum(o.trust == trust for o in outcomes)} {trust}" for trust in trusts))
    kinds = sorted({kind for outcome in outcomes for kind in outcome.said})
    parts.append(" ".join(f"{kind} {sum(kind in o.said for o in outcomes)}" for kind in kinds))
    return " | ".join(parts)


def _outcome(seed: int, width_m: float) -> Outcome:
    return outcome_of(strip_test(seed, width_m))


def _outcome_of_any(seed: int, narrowest_m: float, widest_m: float) -> Outcome:
    width_m = np.random.default_rng([seed, 6]).uniform(narrowest_m, widest_m)
    return outcome_of(strip_test(seed, width_m))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m studies.restitution.yielding", description=__doc__)
    parser.add_argument("--tests", type=int, default=60, help="tests for each width")
    parser.add_argument("--first-seed", type=int, default=7000)
    parser.add_argument("--widths-mm", type=float, nargs="*", default=[1e3 * width for width in WIDTHS_M])
    parser.add_argument(
        "--drawn-mm",
        type=float,
        nargs=2,
        metavar=("LOW", "HIGH"),
        help="draw the width of each test's strip between these",
    )
    parser.add_argument("--workers", type=int, default=None, help="processes; all cores if left out")
    options = parser.parse_args()
    seeds = range(options.first_seed, options.first_seed + options.tests)
    with process_pool(options.workers) as pool:
        if options.drawn_mm:
            low_mm, high_mm = options.drawn_mm
            drawn = partial(_outcome_of_any, narrowest_m=1e-3 * low_mm, widest_m=1e-3 * high_mm)
            print(line_of(f"{low_mm:g}–{high_mm:g}", list(pool.map(drawn, seeds))))
            return
        for width_mm in options.widths_mm:
            outcomes = list(pool.map(partial(_outcome, width_m=1e-3 * width_mm), seeds))
            print(line_of(f"{width_mm:g}", outcomes), flush=True)


if __name__ == "__main__":
    main()

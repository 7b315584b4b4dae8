"""``python -m studies.restitution.campaigns --campaigns 60``: campaigns of laboratories that differ.

What one laboratory keeps from test to test (calibration, places of sensors, datum, clock, the error of the
surveyed body) is in all tests of a campaign alike and is not averaged away by their number. Each draws
its laboratory and its wall; its tests are analysed one by one and joined by the report's own code.
Counted is how often the intervals of `campaign report` hold the truth: of the mean r, of the corrected
mean, and of the change at the repetition, which is zero.

The tests of a campaign are simulated with one r. What r does from test to test is put on afterwards, many
times for each campaign: the values of r found are multiplied by what is drawn.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from daq_app.campaign.names import TestName
from daq_app.campaign.report.tables import repetition_effect, table_4_1
from daq_app.campaign.status import RecordedTest, TestVerdict
from daq_app.campaign.summaries.of_run import summarise
from daq_app.campaign.summaries.summary import TestSummary
from daq_app.config import Rig, load_rig
from daq_app.rocking import AnalysisOptions, analyse_record
from studies.restitution.laboratory import draw_test

RIG: Final = Path(__file__).parents[2] / "configs" / "fr1.toml"
TESTS: Final = (*(f"FR1-{level}-{n}" for level in ("L1", "L2", "L3") for n in (1, 2, 3)), "FR1-L3-R")
"""Tests of a campaign; where the wall is released, each draws for itself."""
TEST_SCATTERS: Final = (0.0, 0.002, 0.005)
"""Relative standard deviations of r from test to test; `campaign simulate` draws the last."""
_OPTIONS: Final = AnalysisOptions(keep_series=False)


@dataclass(frozen=True, slots=True)
class Campaign:
    """The tests of one laboratory and wall, and the r of all of them."""

    true_r: float
    tests: tuple[TestSummary, ...]

    def scattered(self, factors: Iterable[float]) -> list[TestSummary]:
        """The tests with what would be found where r of each is another one by its factor."""
        return [
            replace(test, methods={k: replace(m, r=m.r * factor) for k, m in test.methods.items()})
            for test, factor in zip(self.tests, factors, strict=True)
        ]


def draw_campaign(nominal: Rig, seed: int, names: Sequence[str] = TESTS) -> Campaign:
    """The campaign of the laboratory `seed`, analysed; tests in which no motion is found are left out."""
    made, true_r = [], float("nan")
    for number, name in enumerate(names):
        test = draw_test(nominal, seed * 1000 + number, laboratory=seed)
        true_r = float(test.truth["restitution"])
        analysis = analyse_record(test.record(label=name), _OPTIONS)
        if analysis.found:
            recorded = RecordedTest(TestName.parse(name), TestVerdict.GOOD, 0, Path(f"{name}.h5"))
            made.append(summarise(recorded, nominal, analysis))
    return Campaign(true_r, tuple(made))


@dataclass(frozen=True, slots=True)
class Held:
    """One stated interval of one campaign."""

    what: str
    error: float
    half_width: float


def intervals_of(tests: Sequence[TestSummary], true_r: float) -> list[Held]:
    """What the report states of a campaign, as errors against the truth."""
    held = []
    for row in table_4_1(tests):
        for what, group in (("mean", row.mean), ("corrected", row.corrected)):
            half = (group.high95 - group.low95) / 2.0
            held.append(Held(f"{what} {row.method}", group.mean - true_r, half))
    for change in repetition_effect(tests):
        low, high = change.change_interval95
        held.append(Held(f"change {change.method}", change.change, (high - low) / 2.0))
    return held


def table(campaigns: Sequence[Campaign], draws: int) -> list[str]:
    """A line for each stated interval and scatter from test to test."""
    rng = np.random.default_rng(0)
    lines = [f"{'':16s} {'scatter':>8s} {'holds':>7s} {'rms error':>10s} {'half width':>11s}  campaigns"]
    for scatter in TEST_SCATTERS:
        found: dict[str, list[Held]] = {}
        for campaign in campaigns:
            # Without a scatter there is nothing to draw.
            for _ in range(draws if scatter else 1):
                factors = 1.0 + scatter * rng.standard_normal(len(campaign.tests))
                for held in intervals_of(campaign.scattered(factors), campaign.true_r):
                    found.setdefault(held.what, []).append(held)
        for what, group in found.items():
            errors = np.array([held.error for held in group])
            halves = np.array([held.half_width for held in group])
            share, rms = np.mean(np.abs(errors) <= halves), np.sqrt(np.mean(errors**2))
            sizes = f"{rms:10.5f} {np.mean(halves):11.5f}"
            lines.append(f"{what:16s} {scatter:8.1%} {share:7.1%} {sizes}  {len(campaigns)}")
    return lines


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m studies.restitution.campaigns", description=__doc__)
    parser.add_argument("--campaigns", type=int, default=60)
    parser.add_argument("--first-seed", type=int, default=500)
    parser.add_argument("--draws", type=int, default=50, help="of r from test to test, for each campaign")
    options = parser.parse_args()
    rig = load_rig(RIG)
    seeds = range(options.first_seed, options.first_seed + options.campaigns)
    print("\n".join(table([draw_campaign(rig, seed) for seed in seeds], options.draws)))


if __name__ == "__main__":
    main()

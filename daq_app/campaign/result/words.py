"""What a result says in words and rows, on the window's page as in the files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from daq_app.campaign.summaries.summary import TestSummary
from daq_app.config.shown_text import one_line

METHODS: Final = ("EAV", "CRT")


@dataclass(frozen=True, slots=True)
class RepetitionRow:
    """One test of the level in the comparison."""

    test: str
    phi0: float
    impacts: int
    r: dict[str, float | None]
    good: bool
    this: bool


def repetition_rows(
    test: TestSummary, earlier: Sequence[TestSummary], later: Sequence[TestSummary] = ()
) -> list[RepetitionRow]:
    """The test between the others of its level, in the order given."""
    return [
        RepetitionRow(
            test=one.test,
            phi0=one.phi0,
            impacts=len(one.impacts_s),
            r={name: one.methods[name].r if name in one.methods else None for name in METHODS},
            good=one.good,
            this=one is test,
        )
        for one in [*earlier, test, *later]
    ]


def verdict_sentence(test: TestSummary) -> str:
    """The quality verdict in words, on one line."""
    reasons = one_line("; ".join(test.reasons))
    if test.good and test.trust == "doubtful":
        return f"Well recorded, but r is doubtful: {reasons}."
    if test.good:
        return "Good." + (f" To note: {reasons}." if reasons else "")
    return f"Not good: {reasons or 'rejected'}. The test is offered again."

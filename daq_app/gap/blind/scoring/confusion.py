"""Which truth was answered with what: the confusion matrix of a score."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from daq_app.gap.blind.names import base_name
from daq_app.gap.blind.scoring.judge import Judged

_SEVERAL_OR_NONE: Final = {"pair": "(pair)", "triple": "(triple)", "null": "(nothing)"}


@dataclass(frozen=True, slots=True)
class Confusion:
    """Counts of (truth, answer)."""

    rows: tuple[str, ...]
    columns: tuple[str, ...]
    counts: dict[tuple[str, str], int] = field(default_factory=dict)


def confusion(judged: Sequence[Judged]) -> Confusion:
    """Truth (effect, or how many there are) against answer (effect, or the decision that names none)."""
    counts: dict[tuple[str, str], int] = {}
    for one in judged:
        truth = _SEVERAL_OR_NONE.get(one.category) or one.truth[0]
        answer = f"({one.decision})"
        if one.decision == "effect" and len(one.named) == 1:
            name = base_name(one.named[0])
            # Accepted synonyms stand on the diagonal.
            answer = truth if one.first_right else name
        counts[truth, answer] = counts.get((truth, answer), 0) + 1
    rows = tuple(sorted({truth for truth, _ in counts}))
    columns = tuple(sorted({answer for _, answer in counts}))
    return Confusion(rows, columns, counts)

"""Which truth was answered with what: the confusion matrix of a score."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final

from daq_app.gap.blind.names import base_name
from daq_app.gap.blind.scoring.judge import Judged

_SEVERAL_OR_NONE: Final = {"pair": "(pair)", "triple": "(triple)", "null": "(nothing)"}


def confusion(judged: Sequence[Judged]) -> Counter[tuple[str, str]]:
    """Cases by truth (effect, or how many) and answer (effect, or the decision that names none)."""
    counts: Counter[tuple[str, str]] = Counter()
    for one in judged:
        truth = _SEVERAL_OR_NONE.get(one.category) or one.truth[0]
        answer = f"({one.decision})"
        if one.decision == "effect" and len(one.named) == 1:
            # Accepted synonyms stand on the diagonal.
            answer = truth if one.first_right else base_name(one.named[0])
        counts[truth, answer] += 1
    return counts

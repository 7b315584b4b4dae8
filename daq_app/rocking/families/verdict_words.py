"""The verdict of r as a sentence, the same in the terminal, the window and on paper."""

from __future__ import annotations

from typing import Final

from daq_app.rocking.families.verdict import RVerdict, Trust

_TRUST: Final[dict[Trust, str]] = {
    "good": "good, everything that was recorded agrees",
    "remarks": "with remarks, see the warnings",
    "doubtful": "DOUBTFUL, what it rests on disagrees",
}


def verdict_sentence(verdict: RVerdict) -> str:
    """r, its interval, what it rests on and how far it is to be believed."""
    if verdict.r is None or verdict.interval95 is None:
        return "r: not known, no two half-cycles could be compared"
    low, high = verdict.interval95
    left_out = f", left out: {', '.join(verdict.left_out)}" if verdict.left_out else ""
    return (
        f"r = {verdict.r:.4f} (95 %: {low:.4f} … {high:.4f}) from {', '.join(verdict.used)}{left_out}: "
        f"{_TRUST[verdict.trust]}"
    )

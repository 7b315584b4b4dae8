"""Numbers and marks as people read them, the same in the window, the terminal and the reports."""

from __future__ import annotations

import math
import re
from typing import Final

_MINUS: Final = re.compile(r"(?<![\w\-)])-(?=\.?\d|[xyz]\b)")

METHOD_MARKS: Final = {"EAV": "o", "CRT": "s", "fit": "D"}
"""Mark of each method for r in every figure, as matplotlib and pyqtgraph both spell circle and square."""


def plus_minus(error: float | None, decimals: int = 4) -> str:
    """A standard error behind its value: ``± 0.0021``; what rounds to nothing is ``± < 0.0001``.

    Empty where there is none: a zero of all digits would claim a certainty that no measurement has.
    """
    if error is None or not math.isfinite(error):
        return ""
    least = 10.0**-decimals
    if float(f"{abs(error):.{decimals}f}") == 0.0:
        return f"± < {least:.{decimals}f}"
    return f"± {abs(error):.{decimals}f}"


def signed(value: float, spec: str = "g") -> str:
    """A number in the format `spec`, with a true minus sign."""
    return f"{value:{spec}}".replace("-", "−")


def true_minus(text: str) -> str:
    """The text with true minus signs before numbers and axes (``-3.2``, ``-x``); hyphens in names stay."""
    return _MINUS.sub("−", text)

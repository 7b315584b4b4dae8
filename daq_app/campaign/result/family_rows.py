"""What each sensor family says of a test, as the rows of a table: window, HTML and PDF show the same."""

from __future__ import annotations

import math
from typing import Final

from daq_app.campaign.summaries.summary import TestSummary
from daq_app.config.wording import plus_minus, signed
from daq_app.rocking.families.verdict import FamilyView

HEADINGS: Final = ("Family", "θ0, mrad", "r EAV", "r CRT", "Impacts", "Late, ms", "Remarks")
CAPTION: Final = "± is half of the 95 % interval; r and θ0 rest on the families with a star."
_DASH: Final = "–"
_NORMAL95: Final = 1.96


def family_rows(test: TestSummary) -> list[tuple[str, ...]]:
    """One row per family under `HEADINGS`; the survey, which says nothing of θ0 and r, has none."""
    return [_row(view) for view in test.families if view.family != "survey"]


def _row(view: FamilyView) -> tuple[str, ...]:
    theta0 = _number(1e3 * view.theta0_rad, 2)
    error = plus_minus(_NORMAL95 * 1e3 * view.sigma_theta0_rad, 2) if theta0 != _DASH else ""
    return (
        view.family + (" *" if view.used else ""),
        f"{theta0} {error}".rstrip(),
        _with_interval(view.eav, view.interval95_eav),
        _with_interval(view.crt, view.interval95_crt),
        str(view.impacts or _DASH),
        _number(1e3 * view.late_s, 2),
        ", ".join(view.remarks),
    )


def _with_interval(r: float, interval95: tuple[float, float] | None) -> str:
    if interval95 is None:
        return _number(r, 4)
    return f"{_number(r, 4)} {plus_minus(0.5 * (interval95[1] - interval95[0]))}"


def _number(value: float, digits: int) -> str:
    if not math.isfinite(value):
        return _DASH
    # A sum with zero has no negative zero.
    return signed(round(value, digits) + 0.0, f".{digits}f")

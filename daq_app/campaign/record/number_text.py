"""Numbers, times and lengths as a test record prints them."""

from __future__ import annotations

import datetime as dt
import math
from typing import Final

from daq_app.config.wording import signed

MISSING: Final = "–"


def figure(value: object, decimals: int, unit: str = "") -> str:
    """With so many decimals and a true minus sign; a dash for what is not known."""
    if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
        return MISSING
    text = signed(round(value, decimals) + 0.0, f".{decimals}f")  # what rounds to nothing has no sign
    return f"{text} {unit}" if unit else text


def significant(value: object, digits: int = 3) -> str:
    """With so many significant digits; a dash for what is not known."""
    if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
        return MISSING
    return signed(value, f".{digits}g")


def moment(utc: dt.datetime) -> str:
    """Date and time to the second, in UTC."""
    return utc.astimezone(dt.UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def moment_of(text: str) -> str:
    """An ISO time as stored; as it stands where it is none, a dash where there is none."""
    try:
        return moment(dt.datetime.fromisoformat(text))
    except ValueError:
        return text or MISSING


def said(text: str) -> str:
    """Words, or a dash where there are none."""
    return text.strip() or MISSING

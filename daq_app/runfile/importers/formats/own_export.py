"""What `daq-app export` wrote beside the samples, read back: when the first of them was taken."""

from __future__ import annotations

import json
import re
from typing import Final

from daq_app.runfile.model import LATEST_NS

_LINE: Final = re.compile(r"# (first_row_utc_ns|start_utc_ns): (\d{1,18}\d?)\s*$")


def start_in_line(line: str) -> tuple[str, int] | None:
    """(key, nanoseconds) of a comment line of a CSV that tells it; None of any other."""
    match = _LINE.match(line)
    return None if match is None or not _possible(int(match[2])) else (match[1], int(match[2]))


def start_in_json(text: str) -> int | None:
    """Wall clock of the first sample in the metadata of an export; None where it does not say."""
    try:
        metadata = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(metadata, dict):
        return None
    return start_of(metadata)


def start_of(told: dict[str, object]) -> int | None:
    """The first row's own time; of exports that have none, the run's."""
    for key in ("first_row_utc_ns", "start_utc_ns"):
        value = told.get(key)
        if isinstance(value, int) and not isinstance(value, bool) and _possible(value):
            return value
    return None


def _possible(ns: int) -> bool:
    return 0 < ns <= LATEST_NS

"""CSV: lines of metadata behind ``#``, one line of names, then numbers that read back exactly."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

import numpy as np

from daq_app.runfile.exporters.selection import Selection

_ROWS: Final = 2048
"""Rows that are Python objects at a time: they take ten times the memory of the array."""


def write(path: Path, selection: Selection) -> None:
    """Columns ``time_s`` and one per channel; ``nan`` in gaps. Every number is its shortest exact text."""
    with path.open("w", encoding="utf-8", newline="\n") as file:
        for key, value in selection.metadata().items():
            file.write(f"# {key}: {json.dumps(value, ensure_ascii=False)}\n")
        for channel_id, unit in zip(selection.ids, selection.channel_units, strict=True):
            known = json.dumps(selection.channel_metadata(channel_id), ensure_ascii=False)
            file.write(f"# channel {channel_id} [{unit}]: {known}\n")
        file.write(",".join(("time_s", *selection.ids)) + "\n")
        for times, values in selection.pieces():
            # repr of a Python float is the shortest text that reads back to the same bits.
            table = np.vstack([times, values]).T
            for start in range(0, len(table), _ROWS):
                rows = table[start : start + _ROWS].tolist()
                file.writelines(",".join(map(repr, row)) + "\n" for row in rows)

"""MATLAB 5 files: one variable per channel, and what is known of them in structures."""

from __future__ import annotations

import json
import math
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from scipy.io import savemat

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.exporters.selection import Selection

_MAX_SAMPLES = 2**31 // 8 - 1024
"""A variable of this format holds less than 2 GB."""


def write(path: Path, selection: Selection) -> None:
    """Variables ``time_s``, the channels (``LV-A01`` becomes ``LV_A01``), ``channels``, ``run``.

    With derived data also ``rotation``, ``velocity`` … and the structure array ``results``.
    """
    if selection.n_samples > _MAX_SAMPLES:
        raise RunFileError(
            f"{selection.run.path} is too long for a MATLAB 5 file",
            advice="Export it in parts (--from, --to).",
        )
    names = _variable_names((*selection.ids, *(column.name for column in selection.derived)))
    run = selection.metadata()
    run_json = json.dumps(run)
    run["events"] = _records(run["events"], ("sample", "kind", "text"))
    run["gaps"] = _records(run["gaps"], ("first_sample", "n_samples", "reason"))
    with path.open("wb") as file:
        _put(file, "run", run)
        _put(file, "time_s", selection.run.time_s(selection.start, selection.stop)[:, None])
        channels = []
        for number, (channel_id, unit) in enumerate(zip(selection.ids, selection.channel_units, strict=True)):
            # savemat writes the head of the file only at its beginning, so variables can be appended
            # and only one is in memory.
            column = np.concatenate(list(selection.channel_pieces(channel_id)))
            _put(file, names[channel_id], column[:, None])
            known = selection.channel_metadata(channel_id)
            known = {
                key: np.array(value) if isinstance(value, list) else value for key, value in known.items()
            }
            channels.append({"id": channel_id, "variable": names[channel_id], "unit": unit, "known": known})
            selection.report((number + 1) / len(selection.ids))
        for signal in selection.derived:
            _put(file, names[signal.name], signal.values[:, None])
        if selection.results:
            rows = [asdict(row) for row in selection.results]
            rows = [row | {"sigma": math.nan if row["sigma"] is None else row["sigma"]} for row in rows]
            _put(file, "results", _records(rows, ("quantity", "source", "n", "value", "sigma", "unit")))
        listing = [{key: row[key] for key in ("id", "variable", "unit")} for row in channels]
        # For programs that read no structures.
        _put(file, "channels_json", json.dumps(listing))
        _put(file, "run_json", run_json)
        _put(file, "channels", _records(channels, ("id", "variable", "unit", "known")))


def _put(file: BinaryIO, name: str, value: object) -> None:
    savemat(file, {name: value}, long_field_names=True)


def _records(rows: list[dict[str, Any]], fields: tuple[str, ...]) -> object:
    """A MATLAB structure array."""
    table = np.empty((len(rows), 1), dtype=[(field, object) for field in fields])
    for index, row in enumerate(rows):
        table[index, 0] = tuple(row[field] for field in fields)
    return table


def _variable_names(ids: tuple[str, ...]) -> dict[str, str]:
    """MATLAB identifiers, each used once."""
    names: dict[str, str] = {}
    used = {"run", "run_json", "time_s", "channels", "channels_json", "results"}
    for channel_id in ids:
        stem = re.sub(r"\W", "_", channel_id, flags=re.ASCII)
        stem = (stem if stem[0].isalpha() else f"ch_{stem}")[:56]
        name, number = stem, 2
        while name in used:
            name, number = f"{stem}_{number}", number + 1
        used.add(name)
        names[channel_id] = name
    return names

"""CSV: lines of metadata behind ``#``, one line of names, then numbers that read back exactly."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config.shown_text import csv_cell, has_picture, one_line
from daq_app.runfile.exporters.selection import Selection

_ROWS: Final = 2048
"""Rows that are Python objects at a time: they take ten times the memory of the array."""

_STRING: Final = re.compile(r'"(?:[^"\\]|\\.)*"')
"""A string of JSON."""

Formatter = Callable[[NDArray[np.float64]], Iterator[bytes]]


def write(path: Path, selection: Selection) -> None:
    """Columns ``time_s``, one per channel and derived signal; ``nan`` in gaps. Numbers are exact.

    With decimal commas the columns are parted by semicolons.
    """
    lines_of = _formatter() if selection.decimal == "point" else _with_commas
    between = "," if selection.decimal == "point" else ";"
    with path.open("wb") as file:
        for key, value in selection.metadata().items():
            file.write(f"# {key}: {_one_cell(value)}\n".encode())
        for channel_id, unit in zip(selection.ids, selection.channel_units, strict=True):
            known = _one_cell(selection.channel_metadata(channel_id))
            file.write(f"# channel {one_line(channel_id)} [{one_line(unit)}]: {known}\n".encode())
        for column in selection.derived:
            known = _one_cell({"long_name": column.long_name})
            file.write(f"# derived {one_line(column.name)} [{one_line(column.unit)}]: {known}\n".encode())
        names = ("time_s", *selection.ids, *(column.name for column in selection.derived))
        file.write(_line_of_names(names, between).encode())
        at = 0
        for times, values in selection.pieces():
            derived = [column.values[at : at + times.size] for column in selection.derived]
            file.writelines(lines_of(np.vstack([times, values, *derived])))
            at += times.size


def _one_cell(value: object) -> str:
    """JSON whose strings neither end a cell nor a line of a spreadsheet, and show what they hold."""
    text = json.dumps(value, ensure_ascii=False)
    return _STRING.sub(lambda string: "".join(map(_escaped, string[0])), text)


def _escaped(character: str) -> str:
    if character not in ",;=" and has_picture(character):
        return character
    return "".join(f"\\u{unit:04x}" for unit in memoryview(character.encode("utf-16-le")).cast("H"))


def _line_of_names(names: tuple[str, ...], between: str) -> str:
    line = io.StringIO()
    csv.writer(line, delimiter=between, lineterminator="\n").writerow(map(csv_cell, names))
    return line.getvalue()


def _formatter() -> Formatter:
    """Arrow's, which is five times as fast, where it is installed; else Python's own. Both are exact."""
    try:
        import pyarrow.csv  # noqa: F401  # part of the optional extra `formats`
    except ImportError:
        return _by_python
    return _by_arrow


def _by_python(columns: NDArray[np.float64]) -> Iterator[bytes]:
    """(columns, m) to lines; repr of a Python float is the shortest text that reads back to the same bits."""
    table = columns.T
    for start in range(0, len(table), _ROWS):
        rows = table[start : start + _ROWS].tolist()
        yield "".join(",".join(map(repr, row)) + "\n" for row in rows).encode()


def _with_commas(columns: NDArray[np.float64]) -> Iterator[bytes]:
    for lines in _by_python(columns):
        yield lines.replace(b",", b";").replace(b".", b",")


def _by_arrow(columns: NDArray[np.float64]) -> Iterator[bytes]:
    import pyarrow as pa
    import pyarrow.csv as pa_csv

    sink = pa.BufferOutputStream()
    table = pa.table(list(columns), names=[str(index) for index in range(len(columns))])
    pa_csv.write_csv(table, sink, pa_csv.WriteOptions(include_header=False))
    yield sink.getvalue().to_pybytes()

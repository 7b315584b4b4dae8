"""A list of sensors from a spreadsheet: a workbook, or CSV of any separator; decimal point or comma."""

from __future__ import annotations

import csv
import datetime as dt
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from daq_app.config.authoring.sensor import Position, Sensor
from daq_app.config.authoring.workbook import first_sheet
from daq_app.config.errors import ConfigError, Problem

_TO_M: Final = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
_HEADER: Final = re.compile(r"^(?P<name>.+?)[\s_]*[\[(]?(?:(?<=[\s_\[(])(?P<unit>mm|cm|m))?[\])]?$")
_LENGTHS: Final = frozenset({"x", "y", "z", "anchor x", "anchor y", "anchor z"})
_NEEDED: Final = ("id", "family", "x", "y", "z")
_DAYS: Final = ("%Y-%m-%d", "%d.%m.%Y", "%d/%m/%Y")


_WORKBOOK_ZERO: Final = dt.date(1899, 12, 30)
"""Day 0 of a workbook's dates (after February 1900, which it takes for a leap year)."""
_MEASUREMENTS: Final = ("voltage", "iepe", "lvdt_native", "current", "bridge", "thermocouple")


def _one_of(*allowed: str) -> tuple[Callable[[str], str], str]:
    """Reader of a word, and what it should be."""

    def read(text: str) -> str:
        word = text.strip().casefold().replace(" ", "_")
        for name in allowed:
            if word == name.casefold():
                return name
        raise ValueError(text)

    return read, f"one of {', '.join(allowed)}"


def _number(text: str) -> float:
    return float(text.replace(",", "."))


def _day(text: str) -> dt.date:
    if re.fullmatch(r"\d{5}(\.\d+)?", text):  # as a workbook keeps a day
        return _WORKBOOK_ZERO + dt.timedelta(days=int(float(text)))
    for form in _DAYS:
        try:
            return dt.datetime.strptime(text, form).date()
        except ValueError:
            continue
    raise ValueError(text)


_READ: Final[Mapping[str, tuple[Callable[[str], Any], str]]] = {
    "axis": (str.lower, "x, y or z"),
    "sensitivity": (_number, "a number"),
    "sensitivity unit": (str, "text"),
    "unit": (str, "text"),
    "offset": (_number, "a number, in volts"),
    "measurement": _one_of(*_MEASUREMENTS),
    "thermocouple": _one_of(*"BEJKNRST"),
    "bridge": _one_of("full", "half", "quarter"),
    "bridge ohm": (_number, "a number, Ω"),
    "excitation": (_number, "a number, in volts"),
    "polarity": (int, "1 or -1"),
    "noise": (_number, "a number, SI"),
    "range from": (_number, "a number, SI"),
    "range to": (_number, "a number, SI"),
    "certificate": (str, "text"),
    "calibrated": (_day, "a day such as 2026-02-16"),
    "due": (_day, "a day such as 2026-02-16"),
}
"""Column → how it is read and what it should be."""
_KEY_OF: Final[Mapping[str, str]] = {
    **{name: name for name in ("axis", "sensitivity", "offset", "polarity", "unit")},
    **{name: name for name in ("measurement", "thermocouple", "bridge")},
    "sensitivity unit": "sensitivity_unit",
    "noise": "noise_si",
    "bridge ohm": "bridge_ohm",
    "excitation": "excitation_value",
}
"""Column → key of a sensor."""
_CHANNEL: Final = "channel"
COLUMNS: Final = (*_NEEDED, _CHANNEL, "anchor x", "anchor y", "anchor z", *_READ)
"""All columns. ``id, family, x, y, z`` must be there; lengths may carry their unit: ``x [mm]``."""


def read_sensor_table(path: Path) -> list[Sensor]:
    """Sensors of a list, in its order. Raises `ConfigError` with every cell that cannot be read."""
    rows = first_sheet(path) if path.suffix.lower() == ".xlsx" else _csv_rows(path)
    columns = [_column(name) for name in rows[0]] if rows else []
    names = [name for name, _ in columns]
    problems = [
        Problem(str(path), "first line", f"there is no column `{name}`", f"Columns: {', '.join(COLUMNS)}")
        for name in _NEEDED
        if name not in names
    ]
    problems += [
        Problem(str(path), "first line", f"`{name}` is no known column", f"Columns: {', '.join(COLUMNS)}")
        for name in names
        if name and name not in COLUMNS
    ]
    if problems:
        raise ConfigError(problems)
    sensors = []
    for line, row in enumerate(rows[1:], start=2):
        cells = {name: cell.strip() for (name, _), cell in zip(columns, row, strict=False) if cell.strip()}
        if cells:
            scale = dict(columns)
            where = f"line {line} ({cells.get('id', 'without id')})"
            sensors.append(_sensor(cells, scale, str(path), where, problems))
    if not sensors:
        problems.append(Problem(str(path), "the file", "lists no sensor", "One sensor a line"))
    if problems:
        raise ConfigError(problems)
    return sensors


def _csv_rows(path: Path) -> list[list[str]]:
    text = _text(path)
    head = text.partition("\n")[0]
    separator = max(";\t,", key=head.count)
    return list(csv.reader(text.splitlines(), delimiter=separator))


def _text(path: Path) -> str:
    try:
        data = path.read_bytes()
    except OSError as error:
        wrong = f"cannot be read ({error.strerror})"
        raise ConfigError([Problem(str(path), "the file", wrong, "Check the name")]) from None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")  # what a spreadsheet writes as plain "CSV"


def _column(header: str) -> tuple[str, float]:
    """(name, factor to metres) of a column's header."""
    match = _HEADER.match(header.strip().lower().replace("_", " "))
    if match is None:
        return "", 1.0
    name = match["name"].strip()
    if name in _LENGTHS:
        return name, _TO_M[match["unit"] or "m"]
    return header.strip().lower().replace("_", " "), 1.0


def _sensor(
    cells: dict[str, str], scale: Mapping[str, float], file: str, where: str, problems: list[Problem]
) -> Sensor:
    def read(name: str, reader: Callable[[str], Any], should: str) -> Any:
        try:
            return reader(cells[name])
        except ValueError:
            wrong = f"`{cells[name]}` is not {should}"
            problems.append(Problem(file, f"{where}, column {name}", wrong, f"Write {should}"))
            return None

    def place(*names: str) -> Position | None:
        missing = [name for name in names if name not in cells]
        if missing:
            return None
        x, y, z = (round((read(n, _number, "a number") or 0.0) * scale[n], 6) for n in names)
        return (x, y, z)

    problems += [
        Problem(file, f"{where}, column {name}", "is empty", "Fill it in")
        for name in _NEEDED
        if name not in cells
    ]
    keys = dict(_keys({name: read(name, *_READ[name]) for name in _READ if name in cells}))
    return Sensor(
        cells.get("id", ""),
        cells.get("family", "").lower(),
        place("x", "y", "z") or (0.0, 0.0, 0.0),
        cells.get(_CHANNEL, ""),
        place("anchor x", "anchor y", "anchor z"),
        keys,
    )


def _keys(cells: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Keys of a rig file's channel from the cells of a row."""
    certificate = {"certificate": "number", "calibrated": "calibrated", "due": "due"}
    given = {key: cells[name] for name, key in certificate.items() if cells.get(name) is not None}
    if given:
        yield "certificate", given
    if cells.get("range from") is not None and cells.get("range to") is not None:
        yield "range_si", [cells["range from"], cells["range to"]]
    for name, key in _KEY_OF.items():
        if cells.get(name) is not None:
            yield key, cells[name]

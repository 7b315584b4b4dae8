"""CSV in its many habits: any delimiter, decimal comma, units in the names or in a line of their own."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Final

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.importers.formats.own_export import start_in_line, start_of
from daq_app.runfile.importers.formats.text_rows import ColumnWriter, lines_of, number, open_text
from daq_app.runfile.importers.import_map import SourceMap
from daq_app.runfile.importers.recording import Findings, ForeignChannel, Spool
from daq_app.runfile.importers.unit_text import is_time

_OWN_CHANNEL: Final = re.compile(r"# channel (\S+) \[([^\]]*)\]")
_UNIT_IN_NAME: Final = re.compile(r"^(.*?)\s*[\[(]([^\])]*)[\])]\s*$")
_MAX_COMMENT_LINES: Final = 10_000
_MAX_COLUMNS: Final = 4096


class CsvReader:
    """See `Reader`. Lines that begin with ``#`` are comments."""

    def __init__(self, path: Path, source: SourceMap) -> None:
        self._path = path
        self._source = source
        self.findings = Findings()
        self._units: dict[str, str] = {}
        self._full_names: dict[str, str] = {}
        """Names as written, with the unit behind them."""
        self._told: dict[str, object] = {}
        """What the comments of this program's own export tell of the time."""
        self._data_line = 0
        """Lines before the first row of numbers."""
        head = self._head_lines()
        self._delimiter = source.delimiter or _delimiter(head)
        self._comma = source.decimal == "," or (
            source.decimal == "" and self._delimiter != "," and bool(re.search(r"\d,\d", head[-1]))
        )
        self._names = self._read_names(head)
        times = [
            name
            for name in self._names
            if name.casefold() in ("time", "t", "time_s", "zeit") or is_time(self._units.get(name, ""))
        ]
        self.time_channel = times[0] if times and not source.time_column else None
        self.time_hint: str | None = None
        start = start_of(self._told)
        self.channels = tuple(
            ForeignChannel(
                name,
                unit=self._units.get(name, ""),
                start_utc_ns=start,
                aliases=(name, self._full_names.get(name, name)),
            )
            for name in self._names
        )
        if source.time_column and source.time_column not in self._names:
            raise RunFileError(
                f"{path} has no column {source.time_column!r}",
                advice=f"It has {', '.join(self._names[:60])}.",
            )

    def copy(self, spool: Spool) -> None:
        columns = [(name, self._names.index(name)) for name in spool.names]
        writer = ColumnWriter(spool, columns, comma=self._comma, ragged=True)
        wrong_width = 0
        with open_text(self._path) as file:
            for count, line in enumerate(lines_of(file, self._path)):
                if count < self._data_line or not line.strip() or line.startswith("#"):
                    continue
                fields = self._split(line)
                wrong_width += len(fields) not in (len(self._names), len(self._names) + 1)
                writer.add(fields)
        writer.flush()
        if wrong_width:
            self.findings.doubts.append(f"{wrong_width} rows have more or fewer fields than there are names")

    def close(self) -> None:
        """Nothing stays open between the calls."""

    def _head_lines(self) -> list[str]:
        """Lines up to and with the first that holds numbers only (behind comments and skipped lines)."""
        head: list[str] = []
        with open_text(self._path) as file:
            for count, line in enumerate(lines_of(file, self._path)):
                if count > _MAX_COMMENT_LINES:
                    break
                channel = _OWN_CHANNEL.match(line)
                if channel:
                    self._units[channel[1]] = channel[2]
                told = start_in_line(line)
                if told:
                    self._told[told[0]] = told[1]
                if count < self._source.skip_lines or not line.strip() or line.startswith("#"):
                    continue
                head.append(line)
                self._data_line = count
                if _is_numbers(line) and (len(head) > 1 or not self._source.has_names):
                    return head
                if len(head) > 3:
                    break
        raise RunFileError(
            f"{self._path}: no row of numbers was found after a line of names",
            advice="Say in the map how it is written: skip_lines, has_names, delimiter, decimal.",
        )

    def _split(self, line: str) -> list[str]:
        if '"' in line:
            return next(csv.reader([line], delimiter=self._delimiter), [])
        return line.split() if self._delimiter == " " else line.split(self._delimiter)

    def _read_names(self, head: list[str]) -> list[str]:
        width = len(self._split(head[-1]))
        if width > _MAX_COLUMNS:
            raise RunFileError(f"{self._path} has {width} columns: it is no recording of a rig")
        if not self._source.has_names:
            return [f"column {number_ + 1}" for number_ in range(width)]
        names = []
        unit_line = self._split(head[1]) if len(head) > 2 else []
        for index, field in enumerate(self._split(head[0])):
            name = field.strip()
            with_unit = _UNIT_IN_NAME.match(name)
            if with_unit and with_unit[1] not in names:
                name = with_unit[1]
                self._units[name] = with_unit[2]
                self._full_names[name] = field.strip()
            if index < len(unit_line) and unit_line[index].strip():
                self._units[name] = unit_line[index].strip().strip("[]()")
            if not name or name in names:
                name = f"{name or 'column'} {index + 1}".strip()
            names.append(name)
        return names


def _delimiter(head: list[str]) -> str:
    """The one that cuts names and numbers into the same number of fields, most fields first."""
    best, fields = ",", 0
    for candidate in ("\t", ";", ",", " "):
        counts = [
            len(line.split() if candidate == " " else line.split(candidate)) for line in (head[0], head[-1])
        ]
        if counts[0] == counts[1] and counts[1] > fields:
            best, fields = candidate, counts[1]
    return best


def _is_numbers(line: str) -> bool:
    """Whether every field that is not empty is a number, by any delimiter."""
    for candidate in ("\t", ";", ",", " "):
        texts = [text for text in line.replace('"', "").split(candidate) if text.strip()]
        # number() turns what is no number into NaN, and NaN is unlike itself; "nan" is a number all the same.
        if texts and all(
            (value := number(text, candidate != ",")) == value or text.strip().casefold() == "nan"
            for text in texts
        ):
            return True
    return False

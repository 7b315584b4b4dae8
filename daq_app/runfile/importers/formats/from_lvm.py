"""LVM, LabVIEW's text format: one head of the file, then one or more pieces with their own heads.

Source: National Instruments, "Specification for the LabVIEW Measurement File (.lvm)".
"""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.importers.formats.text_rows import ColumnWriter, lines_of, number, open_text
from daq_app.runfile.importers.import_map import SourceMap
from daq_app.runfile.importers.recording import Findings, ForeignChannel, Spool

_END: Final = "***End_of_Header***"
_MAX_HEAD_LINES: Final = 1000


@dataclass(slots=True)
class _Piece:
    """Head of one piece of data."""

    names: list[str]
    """Names of all columns, the X columns and the comment included."""
    entries: dict[str, list[str]]

    def value(self, key: str, column: int) -> str:
        fields = self.entries.get(key, [])
        return fields[column].strip() if column < len(fields) else ""


class LvmReader:
    """See `Reader`. The columns of all pieces must be the same."""

    def __init__(self, path: Path, source: SourceMap) -> None:
        self._path = path
        self.findings = Findings()
        with open_text(path) as file:
            lines = lines_of(file, path)
            self._head = self._read_head(lines)
            self._separator = {"comma": ",", "tab": "\t"}.get(
                self._head.get("separator", "tab").casefold(), "\t"
            )
            piece = self._read_piece(lines, None)
            first_row = next(lines, "")
        if piece is None:
            raise RunFileError(f"{path} holds no channels")
        decimal = self._head.get("decimal_separator", "")
        self._comma = (source.decimal or decimal) == ","
        if not decimal and not source.decimal:
            self._comma = self._guess_comma(piece)
        self._believe_the_numbers(first_row, decimal, source)
        if source.start_utc is None and self._moment(piece, 1) is not None:
            self.findings.doubts.append(
                "LVM files have local time without its zone: taken as UTC. Give start_utc in the map, "
                "with its zone"
            )
        self._piece = piece
        self._columns = self._value_columns(piece)
        self.channels = tuple(self._describe(column) for column in self._columns)
        self.time_channel = self._time_column(piece)
        hints = [item.name for item in self.channels if item.name.casefold() in ("time", "t", "zeit")]
        self.time_hint = hints[0] if hints else None
        if self.time_channel:
            self.channels = (*self.channels, ForeignChannel(self.time_channel, unit="s"))

    def copy(self, spool: Spool) -> None:
        wanted = [(name, self._column_of(name)) for name in spool.names]
        with open_text(self._path) as file:
            lines = lines_of(file, self._path)
            self._read_head(lines)
            piece = self._read_piece(lines, None)
            position, began = 0, self._moment(piece, self._columns[0]) if piece else None
            pieces: list[tuple[int, int]] = []
            # One writer for all pieces: a column that ends early in one goes on in the next.
            writer = ColumnWriter(spool, wanted, comma=self._comma, ragged=True)
            while piece is not None:
                if piece.names != self._piece.names:
                    raise RunFileError(f"{self._path} has pieces with different channels: split it first")
                position = max(position, self._start_of(piece, began, position))
                rows_before = writer.n_rows
                piece = self._copy_piece(lines, piece, writer)
                pieces.append((position, writer.n_rows - rows_before))
                position += writer.n_rows - rows_before
            writer.flush()
        if len(pieces) > 1:
            self.findings.pieces = [item for item in pieces if item[1]]
            self.findings.doubts.append(
                f"the file has {len(pieces)} pieces, put one after another by their dates"
            )

    def close(self) -> None:
        """Nothing stays open between the calls."""

    def _read_head(self, lines: Iterator[str]) -> dict[str, str]:
        head: dict[str, str] = {}
        for count, line in enumerate(lines):
            fields = line.replace("\t", ",").split(",") if count == 0 else line.split(self._split_of(line))
            key = fields[0].strip()
            if count == 0 and not key.casefold().startswith("labview measurement"):
                raise RunFileError(
                    f"{self._path} is no LVM file: it does not begin with 'LabVIEW Measurement'"
                )
            if key == _END:
                return head
            if len(fields) > 1:
                head[key.casefold()] = fields[1].strip()
            if count > _MAX_HEAD_LINES:
                break
        raise RunFileError(f"{self._path}: its head has no end ({_END})")

    @staticmethod
    def _split_of(line: str) -> str:
        return "\t" if "\t" in line else ","

    def _read_piece(self, lines: Iterator[str], first: str | None) -> _Piece | None:
        """The next piece's head up to its line of names; None at the end of the file."""
        entries: dict[str, list[str]] = {}
        count = 0
        pending = first
        while True:
            line = pending if pending is not None else next(lines, None)
            pending = None
            if line is None:
                if entries:
                    raise RunFileError(f"{self._path}: the head of a piece has no end")
                return None
            fields = line.split(self._separator)
            key = fields[0].strip()
            if key == _END:
                names = next(lines, None)
                if names is None:
                    raise RunFileError(f"{self._path}: a piece has no line of channel names")
                return _Piece([name.strip() for name in names.split(self._separator)], entries)
            if key:
                entries[key.casefold()] = fields
            count += 1
            if count > _MAX_HEAD_LINES:
                raise RunFileError(f"{self._path}: the head of a piece has no end")

    def _value_columns(self, piece: _Piece) -> list[int]:
        columns = [
            column
            for column, name in enumerate(piece.names)
            if name and name.casefold() not in ("x_value", "comment")
        ]
        if not columns:
            raise RunFileError(f"{self._path} holds no channels")
        return columns

    def _describe(self, column: int) -> ForeignChannel:
        piece = self._piece
        names = [piece.names[other] for other in self._columns]
        name = piece.names[column]
        unique = name if names.count(name) == 1 else f"{name} (column {column + 1})"
        declared = piece.value("samples", column)
        increment = number(piece.value("delta_x", column), self._decimal_is_comma(piece, "delta_x", column))
        return ForeignChannel(
            unique,
            unit=piece.value("y_unit_label", column),
            increment_s=increment if math.isfinite(increment) and self._x_columns() == "no" else None,
            increment_rounding_s=_rounding(piece.value("delta_x", column)),
            start_utc_ns=self._moment(piece, column),
            n_declared=int(declared) if declared.isdigit() and len(declared) < 12 else None,
            aliases=(name,),
        )

    def _column_of(self, name: str) -> int:
        if name == self.time_channel and name not in [item.name for item in self.channels[:-1]]:
            return 0
        return self._columns[[item.name for item in self.channels].index(name)]

    def _x_columns(self) -> str:
        return self._head.get("x_columns", "no").casefold()

    def _time_column(self, piece: _Piece) -> str | None:
        """The X column, where there is one. Channels with X columns of their own share the first."""
        if self._x_columns() not in ("one", "multi") or piece.names[0].casefold() != "x_value":
            return None
        return "X_Value"

    def _decimal_is_comma(self, piece: _Piece, key: str, column: int) -> bool:
        return "," in piece.value(key, column) and self._separator != ","

    def _believe_the_numbers(self, row: str, decimal: str, source: SourceMap) -> None:
        """A head that promises points above numbers with commas: edited, or saved under another language."""
        commas = self._separator != "," and any(
            not math.isfinite(number(field, comma=False)) and math.isfinite(number(field, comma=True))
            for field in row.split(self._separator)
        )
        if commas and not self._comma and not source.decimal:
            self._comma = True
            head_words = f"its head says {decimal!r}" if decimal else "its head does not say so"
            self.findings.doubts.append(
                f"the numbers have decimal commas and {head_words}: the numbers are believed (decimal in the "
                "map goes over it)"
            )

    def _guess_comma(self, piece: _Piece) -> bool:
        """Old writers do not say; the head's own numbers show it where they have a fraction."""
        return any(self._decimal_is_comma(piece, key, 1) for key in ("delta_x", "x0"))

    def _moment(self, piece: _Piece, column: int) -> int | None:
        """Date and time of a column's first sample. LVM gives local time without a zone: taken as UTC."""
        day, clock = piece.value("date", column), piece.value("time", column).replace(",", ".")
        try:
            seconds, _, fraction = clock.partition(".")
            moment = dt.datetime.strptime(f"{day} {seconds}", "%Y/%m/%d %H:%M:%S").replace(tzinfo=dt.UTC)
            return int(moment.timestamp()) * 10**9 + int((fraction + "0" * 9)[:9] or 0)
        except ValueError:
            return None

    def _start_of(self, piece: _Piece, began: int | None, expected: int) -> int:
        """Sample at which a piece starts, by its date; what is within a twentieth of a second is joined."""
        column = self._columns[0]
        moment = self._moment(piece, column)
        increment = number(piece.value("delta_x", column), self._decimal_is_comma(piece, "delta_x", column))
        if moment is None or began is None or not math.isfinite(increment) or increment <= 0:
            return expected
        sample = round((moment - began) / 1e9 / increment)
        return expected if abs(sample - expected) * increment < 0.05 else sample

    def _copy_piece(self, lines: Iterator[str], piece: _Piece, writer: ColumnWriter) -> _Piece | None:
        """Rows of one piece into the writer, comments into the findings; returns the next piece."""
        comment_column = len(piece.names) - 1 if piece.names[-1].casefold() == "comment" else None
        last_comment = ""
        for line in lines:
            fields = line.split(self._separator)
            key = fields[0].strip().casefold()
            if key in ("channels", "notes") or key.startswith("labview"):
                return self._read_piece(lines, line)
            if not line.strip(f"{self._separator} "):
                continue
            writer.add(fields)
            if comment_column is not None and comment_column < len(fields):
                comment = fields[comment_column].strip()
                if comment and comment != last_comment:
                    self.findings.comments.append((writer.n_rows - 1, comment))
                last_comment = comment
        return None


def _rounding(text: str) -> float:
    """Half a unit in the last place of a printed number: 0.000977 stands for 0.000977 ± 0.0000005."""
    mantissa, _, exponent = text.upper().replace(",", ".").partition("E")
    _, _, fraction = mantissa.partition(".")
    try:
        return float(0.5 * 10.0 ** (int(exponent or 0) - len(fraction)))
    except (ValueError, OverflowError):
        return 0.0

"""Rows of numbers out of text files that may be huge, broken, or written in another country."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, TextIO

import numpy as np
from numpy.typing import NDArray

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.importers.recording import Spool

MAX_LINE: Final = 2**20
"""Longest line that is read: 512 numbers take 15 kB."""
_ROWS_AT_ONCE: Final = 8192


def open_text(path: Path) -> TextIO:
    """UTF-8 if it is that, else Latin-1, in which LabVIEW writes ° and ². Raises `RunFileError`."""
    try:
        with path.open("rb") as file:
            head = file.read(2**16)
        if b"\0" in head:
            raise RunFileError(f"{path} is no text file", advice="Is its suffix the right one?")
        encoding = "utf-8-sig"
        try:
            # A character may be cut at the end of what was read.
            head[: max(len(head) - 4, 0)].decode(encoding)
        except UnicodeDecodeError:
            encoding = "latin-1"
        return path.open(encoding=encoding, errors="replace", newline=None)
    except OSError as error:
        raise RunFileError(f"{path} cannot be read ({error.strerror})", advice="Check the name.") from error


def lines_of(file: TextIO, path: Path) -> Iterator[str]:
    """Lines without their ends; refuses absurdly long ones before they fill the memory."""
    while line := file.readline(MAX_LINE):
        if len(line) == MAX_LINE:
            raise RunFileError(f"{path} has a line of more than a million characters: it is no table")
        yield line.rstrip("\r\n")


def number(text: str, comma: bool) -> float:
    """A number, or NaN for an empty field or anything else."""
    text = text.strip()
    if comma:
        text = text.replace(",", ".")
    try:
        return float(text)
    except ValueError:
        return np.nan


class ColumnWriter:
    """Collects rows and appends the chosen columns to the spool, thousands of rows at a time.

    With `ragged`, fields that are empty at the end of a column make the channel shorter, instead of
    being missing values.
    """

    def __init__(
        self, spool: Spool, columns: Sequence[tuple[str, int]], *, comma: bool, ragged: bool
    ) -> None:
        self._spool = spool
        self._columns = columns
        self._comma = comma
        self._ragged = ragged
        self._rows: list[list[str]] = []
        self._empty = {name: 0 for name, _ in columns}
        self.n_rows = 0

    def add(self, fields: list[str]) -> None:
        """One row; missing fields are empty ones."""
        self._rows.append(fields)
        self.n_rows += 1
        if len(self._rows) >= _ROWS_AT_ONCE:
            self.flush()

    def flush(self) -> None:
        """Write what is waiting."""
        for name, column in self._columns:
            texts = [row[column] if column < len(row) else "" for row in self._rows]
            try:
                values = np.array([float(text) for text in texts])  # the fast way, for clean numbers
            except ValueError:
                values = np.array([number(text, self._comma) for text in texts])
                if self._ragged:
                    values = self._without_empty_end(name, texts, values)
                else:
                    self._spool_empty(name)
            else:
                self._spool_empty(name)
            self._spool.append(name, values)
        self._rows.clear()

    def _spool_empty(self, name: str) -> None:
        """Empty fields that turned out not to be at the end of the column are missing values."""
        if self._empty[name]:
            self._spool.append(name, np.full(self._empty[name], np.nan))
            self._empty[name] = 0

    def _without_empty_end(
        self, name: str, texts: list[str], values: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        end = len(texts)
        while end and not texts[end - 1].strip():
            end -= 1
        if end:
            self._spool_empty(name)
        self._empty[name] += len(texts) - end
        return values[:end]

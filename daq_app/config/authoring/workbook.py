"""The first sheet of an Excel workbook (``.xlsx``, ECMA-376) as rows of text."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

from daq_app.config.errors import ConfigError, Problem

_MAIN: Final = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
_SHEET: Final = re.compile(r"xl/worksheets/sheet(\d+)\.xml")
_STRINGS: Final = "xl/sharedStrings.xml"
_MAX_BYTES: Final = 16 * 1024 * 1024
"""Largest part of a workbook that is unpacked: a list of sensors has some kilobytes."""
_MAX_COLUMNS: Final = 1000


def first_sheet(path: Path) -> list[list[str]]:
    """Rows of the first sheet, with empty cells as empty text. Raises `ConfigError`."""
    try:
        with zipfile.ZipFile(path) as book:
            sheets = sorted(filter(_SHEET.fullmatch, book.namelist()), key=_number_of)
            shared = list(_strings(_part(book, _STRINGS))) if _STRINGS in book.namelist() else []
            return [_row(row, shared) for row in _part(book, sheets[0]).iter(f"{_MAIN}row")]
    except OSError as error:
        wrong = f"cannot be read ({error.strerror})"
        raise ConfigError([Problem(str(path), "the file", wrong, "Check the name")]) from None
    except (zipfile.BadZipFile, ElementTree.ParseError, LookupError, ValueError, RuntimeError, EOFError):
        right = "Save it again as .xlsx, or as CSV"
        raise ConfigError([Problem(str(path), "the file", "is no Excel workbook", right)]) from None


def _number_of(name: str) -> int:
    match = _SHEET.fullmatch(name)
    return int(match[1]) if match else 0


def _part(book: zipfile.ZipFile, name: str) -> ElementTree.Element:
    if book.getinfo(name).file_size > _MAX_BYTES:
        raise ValueError(f"{name} is larger than any list of sensors")
    text = book.read(name)
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:  # a workbook has none, and entities can grow without end
        raise ValueError(f"{name} declares entities")
    return ElementTree.fromstring(text)


def _strings(table: ElementTree.Element) -> Iterator[str]:
    for item in table.iter(f"{_MAIN}si"):
        yield _text(item)


def _text(item: ElementTree.Element) -> str:
    """The text of an item: of its runs, without the phonetic reading that East Asian ones carry."""
    parents = [item, *item.iter(f"{_MAIN}r")]
    return "".join(child.text or "" for parent in parents for child in parent.findall(f"{_MAIN}t"))


def _row(row: ElementTree.Element, shared: list[str]) -> list[str]:
    cells: list[str] = []
    for cell in row.iter(f"{_MAIN}c"):
        column = _column(cell.get("r", "")) if cell.get("r") else len(cells)
        if column >= _MAX_COLUMNS:
            raise ValueError(f"column {column} of a list of sensors")
        cells += [""] * (column - len(cells))
        cells.append(_value(cell, shared))
    return cells


def _value(cell: ElementTree.Element, shared: list[str]) -> str:
    if cell.get("t") == "inlineStr":
        inner = cell.find(f"{_MAIN}is")
        return _text(inner) if inner is not None else ""
    value = cell.findtext(f"{_MAIN}v") or ""
    return shared[int(value)] if cell.get("t") == "s" else value


def _column(reference: str) -> int:
    """0 for ``A1``, 27 for ``AB7``."""
    number = 0
    for letter in reference.rstrip("0123456789"):
        number = 26 * number + ord(letter.upper()) - ord("A") + 1
    return number - 1

"""Text that somebody typed, made fit to be shown: in a terminal, a table, a page, a spreadsheet.

A name or a note may hold anything. What is stored stays as it was typed; each way out shows it so that it can
neither act (escape codes, formulas) nor deceive (letters that turn the reading order, that nobody sees).
"""

from __future__ import annotations

import re
import unicodedata
from typing import Final

_JOINERS: Final = frozenset("\u200c\u200d")
"""Format characters that letters and emoji are made with; they show by what they join."""
_HIDDEN: Final = frozenset({"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"})
"""Categories of Unicode without a picture: control, format, halves of pairs, private, unassigned, breaks."""
_FORMULA: Final = ("=", "+", "-", "@", "\t", "\r", "\n")
"""First characters at which a spreadsheet takes a cell for a formula (OWASP, CSV injection)."""
_NUMBER: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def visible(text: str) -> str:
    """The text with every character that has no picture written as its code; line breaks and tabs stay."""
    return "".join(character if has_picture(character) else _code(character) for character in text)


def one_line(text: str) -> str:
    """The same on one line: each run of white space is one blank."""
    return visible(" ".join(text.split()))


def shortened(text: str, length: int) -> str:
    """On one line with at most `length` characters; an ellipsis stands for the rest."""
    line = one_line(text)
    return line if len(line) <= length else line[: length - 1].rstrip() + "…"


def csv_cell(value: object) -> object:
    """A cell of a CSV file that no spreadsheet takes for a formula; numbers stay what they are."""
    if not isinstance(value, str):
        return value
    shown = visible(value)
    if shown.lstrip(" ").startswith(_FORMULA) and not _NUMBER.fullmatch(shown):
        return f"'{shown}"
    return shown


def has_picture(character: str) -> bool:
    """Whether a reader sees the character, or it only parts words and lines."""
    return character in "\n\t" or character in _JOINERS or unicodedata.category(character) not in _HIDDEN


def _code(character: str) -> str:
    return f"⟨U+{ord(character):04X}⟩"

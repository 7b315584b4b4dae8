"""What a test record consists of, apart from how it is set on pages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Tone = Literal["plain", "good", "warning", "bad"]


@dataclass(frozen=True, slots=True)
class Words:
    """A paragraph."""

    text: str
    tone: Tone = "plain"


@dataclass(frozen=True, slots=True)
class Pairs:
    """What is said of one thing: label and value, one below the other."""

    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Grid:
    """A table; its heading stands on every page that it goes on over."""

    heading: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    widths: tuple[float, ...]
    """Relative widths of the columns."""
    small: bool = False


@dataclass(frozen=True, slots=True)
class Picture:
    """A drawn figure as PNG, over the width of the page, with its caption."""

    png: bytes
    caption: str


@dataclass(frozen=True, slots=True)
class Signatures:
    """Lines for name, date and signature of each role; they stay together on one page."""

    roles: tuple[str, ...]


Part = Words | Pairs | Grid | Picture | Signatures


@dataclass(frozen=True, slots=True)
class Section:
    """A heading with what stands below it."""

    heading: str
    parts: Sequence[Part]


@dataclass(frozen=True, slots=True)
class Document:
    """A whole test record."""

    title: str
    subtitle: str
    footer: str
    """Stands on every page: what ties a loose page to its run."""
    sections: Sequence[Section]

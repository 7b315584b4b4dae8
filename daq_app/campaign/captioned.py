"""A figure with its caption, and as SVG."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Final

import matplotlib as mpl
from matplotlib.figure import Figure

PLAIN_TEXT: Final = {"text.parse_math": False}
"""Setting of matplotlib under which a dollar sign that somebody typed begins no formula."""


@dataclass(frozen=True, slots=True)
class CaptionedFigure:
    """A figure with the file name it is saved under and its caption."""

    name: str
    figure: Figure
    caption: str

    @property
    def svg(self) -> str:
        """The picture as an SVG element that can stand inside a page."""
        buffer = io.StringIO()
        # A fixed salt makes the file depend on the data alone.
        with mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": self.name}):
            self.figure.savefig(buffer, format="svg", metadata={"Date": None})
        text = buffer.getvalue()
        return text[text.index("<svg") :]

"""Sets a test record on A4 pages as PDF. Every letter is shown: one that the font lacks by its code."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Final

import matplotlib as mpl
from fpdf import FPDF
from fpdf.enums import TableBordersLayout, WrapMode, XPos, YPos
from fpdf.fonts import FontFace, TTFFont

from daq_app.campaign.record.parts import (
    Document,
    Grid,
    Pairs,
    Part,
    Picture,
    Section,
    Signatures,
    Tone,
    Words,
)
from daq_app.config.shown_text import one_line, visible

_MARGIN_MM: Final = 20.0
_FOOT_MM: Final = 18.0
_FONT: Final = "dejavu"
_TEXT_PT: Final = 9.0
_SMALL_PT: Final = 7.2
_LINE: Final = 1.35
"""Height of a line over the size of its letters."""
_MM_PER_PT: Final = 25.4 / 72.0
_LABEL_SHARE: Final = 0.225
"""Width of the labels in a list of pairs."""
_CELL_CHARACTERS: Final = 900
"""A longer cell goes on in a row of its own: no row of a table is higher than a page."""
_SIGNATURE_MM: Final = 13.0
_TONES: Final[dict[Tone, tuple[int, int, int]]] = {
    "plain": (0, 0, 0),
    "good": (0x1E, 0x6B, 0x33),
    "warning": (0x8A, 0x4B, 0x08),
    "bad": (0xB3, 0x26, 0x1E),
}


def document_pdf(document: Document) -> bytes:
    """The document as the bytes of a PDF file."""
    sheet = _Sheet(document)
    sheet.add_page()
    sheet.title_block()
    for section in document.sections:
        sheet.section(section)
    return bytes(sheet.output())


class _Sheet(FPDF):
    """Pages with a running title and a foot; `section` sets what stands between."""

    def __init__(self, document: Document) -> None:
        super().__init__(format="A4", unit="mm")
        self._document = document
        folder = Path(mpl.get_data_path()) / "fonts" / "ttf"
        self.add_font(_FONT, "", folder / "DejaVuSans.ttf")
        self.add_font(_FONT, "B", folder / "DejaVuSans-Bold.ttf")
        self.set_margins(_MARGIN_MM, _MARGIN_MM, _MARGIN_MM)
        self.set_auto_page_break(True, _FOOT_MM + 4.0)
        self.set_title(one_line(document.title))
        self.set_creator("rocking-test-recorder")
        self._size(_TEXT_PT)
        font = self.current_font
        self._letters = frozenset(font.cmap) if isinstance(font, TTFFont) else frozenset()
        self._text_width = self.epw

    # -- every page --------------------------------------------------------------------------------------

    def header(self) -> None:
        """The running title, from the second page on."""
        if self.page_no() == 1:
            return
        self.set_y(10.0)
        self._size(_SMALL_PT, grey=True)
        self._line(self._document.title)
        self.set_y(_MARGIN_MM)

    def footer(self) -> None:
        """What ties the page to its run, and which of how many pages it is."""
        indented = self.l_margin  # a page may end within an indented value
        self.set_left_margin(_MARGIN_MM)
        self.set_y(-_FOOT_MM)
        self._size(_SMALL_PT, grey=True)
        self.set_draw_color(190)
        self.line(_MARGIN_MM, self.get_y() - 1.0, self.w - _MARGIN_MM, self.get_y() - 1.0)
        height = _SMALL_PT * _LINE * _MM_PER_PT
        self.multi_cell(
            0.86 * self._text_width,
            height,
            self._shown(self._document.footer),
            wrapmode=WrapMode.CHAR,
            new_x=XPos.RIGHT,
            new_y=YPos.TOP,
        )
        self.cell(0, height, f"page {self.page_no()} of {{nb}}", align="R")
        self.set_left_margin(indented)

    # -- parts -------------------------------------------------------------------------------------------

    def title_block(self) -> None:
        """Title and subtitle of the document."""
        self._size(18.0, bold=True)
        self._line(self._document.title)
        self._size(_TEXT_PT, grey=True)
        self._line(self._document.subtitle)

    def section(self, section: Section) -> None:
        """A heading with its parts; a heading never stands alone at the end of a page."""
        first = section.parts[0] if section.parts else None
        needed = _SIGNATURE_MM * (len(first.roles) + 1) if isinstance(first, Signatures) else 22.0
        if self.will_page_break(needed):
            self.add_page()
        self.ln(4.0)
        self._size(11.5, bold=True)
        self._line(section.heading)
        self.set_draw_color(120)
        self.line(_MARGIN_MM, self.get_y(), self.w - _MARGIN_MM, self.get_y())
        self.ln(1.2)
        for part in section.parts:
            self._part(part)

    def _part(self, part: Part) -> None:
        self._size(_TEXT_PT)
        match part:
            case Words(text, tone):
                self.set_text_color(*_TONES[tone])
                self._line(text)
                self.ln(0.8)
            case Pairs(rows):
                for label, value in rows:
                    self._pair(label, value)
                self.ln(1.0)
            case Grid():
                self._grid(part)
            case Picture(png, caption):
                self._picture(png, caption)
            case Signatures(roles):
                self._signatures(roles)

    def _pair(self, label: str, value: str) -> None:
        height = _TEXT_PT * _LINE * _MM_PER_PT
        if self.will_page_break(height):
            self.add_page()
        width = _LABEL_SHARE * self._text_width
        self._size(_TEXT_PT, grey=True)
        left = self.l_margin
        self.multi_cell(width, height, self._shown(label), align="L", new_x=XPos.RIGHT, new_y=YPos.TOP)
        page, below = self.page, self.get_y()
        self._size(_TEXT_PT)
        self.set_left_margin(left + width)  # a value that goes on over a page stays in its column
        self.multi_cell(0, height, self._shown(value), align="L", new_x=XPos.LMARGIN, new_y=YPos.NEXT)
        self.set_left_margin(left)
        self.set_x(left)
        if self.page == page:
            self.set_y(max(self.get_y(), below))

    def _grid(self, grid: Grid) -> None:
        size = _SMALL_PT if grid.small else _TEXT_PT
        self._size(size)
        self.set_draw_color(190)
        with self.table(
            col_widths=grid.widths,
            width=self._text_width,
            borders_layout=TableBordersLayout.HORIZONTAL_LINES,
            headings_style=FontFace(emphasis="BOLD"),
            line_height=size * _LINE * _MM_PER_PT,
            padding=(0.5, 1.0),
            text_align="LEFT",
            first_row_as_headings=True,
            repeat_headings=1,
        ) as table:
            for row in (grid.heading, *grid.rows):
                for piece in _pieces(tuple(map(self._shown, row))):
                    table.row(piece)
        self.ln(1.5)

    def _picture(self, png: bytes, caption: str) -> None:
        height = self._text_width * _png_ratio(png)
        if self.will_page_break(height + 8.0):
            self.add_page()
        self.image(io.BytesIO(png), x=self.l_margin, w=self._text_width, h=height)
        self._size(_SMALL_PT)
        self._line(caption)
        self.ln(1.5)

    def _signatures(self, roles: tuple[str, ...]) -> None:
        self.set_draw_color(90)
        self._size(_SMALL_PT, grey=True)
        widths = [share * self._text_width for share in (0.22, 0.30, 0.18, 0.30)]
        for index, row in enumerate(
            (("", "Name", "Date", "Signature"), *((role, "", "", "") for role in roles))
        ):
            height = 5.0 if index == 0 else _SIGNATURE_MM
            for width, text in zip(widths, row, strict=True):
                self.cell(width, height, self._shown(text), border=1 if index else "B")
            self.ln(height)

    # -- letters -----------------------------------------------------------------------------------------

    def _size(self, points: float, *, bold: bool = False, grey: bool = False) -> None:
        self.set_font(_FONT, "B" if bold else "", points)
        self.set_text_color(95 if grey else 0)

    def _line(self, text: str) -> None:
        height = self.font_size_pt * _LINE * _MM_PER_PT
        self.multi_cell(0, height, self._shown(text), align="L", new_x=XPos.LMARGIN, new_y=YPos.NEXT)

    def _shown(self, text: str) -> str:
        """With the code of each letter that the font has no picture of."""
        return "".join(
            c if c == "\n" or ord(c) in self._letters else f"⟨U+{ord(c):04X}⟩"
            for c in visible(text).replace("\t", " ")
        )


def _pieces(row: tuple[str, ...]) -> list[tuple[str, ...]]:
    """The row, or several with the parts of its long cells one below the other."""
    count = max(1, *(-(-len(cell) // _CELL_CHARACTERS) for cell in row))
    return [
        tuple(cell[start : start + _CELL_CHARACTERS] for cell in row)
        for start in range(0, count * _CELL_CHARACTERS, _CELL_CHARACTERS)
    ]


def _png_ratio(png: bytes) -> float:
    """Height over width of a PNG: its header has both, big-endian, from byte 16 (W3C PNG, 11.2.2)."""
    width, height = int.from_bytes(png[16:20], "big"), int.from_bytes(png[20:24], "big")
    return height / width

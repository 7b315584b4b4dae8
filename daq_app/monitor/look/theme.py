"""Colours, type and spacing of the window: a light and a dark theme that colour-blind eyes can tell apart.

Every meaning that a colour carries is also carried by a shape or a word.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from PySide6.QtGui import QColor, QFont, QPalette
from PySide6.QtWidgets import QApplication, QWidget

from daq_app.config.families import AUXILIARY

AUXILIARY_GROUP: Final = "auxiliary"
"""All families that the rocking analysis leaves out, where they stand together."""
USUAL_POINTS: Final = 10.0
"""Type size for which fixed sizes are written down."""
ThemeName = Literal["dark", "light"]

FONT_FAMILIES: Final = ["Inter", "Segoe UI", "Noto Sans", "DejaVu Sans"]
MONO_FAMILIES: Final = ["Cascadia Mono", "Consolas", "Noto Sans Mono", "DejaVu Sans Mono"]


@dataclass(frozen=True, slots=True)
class Colours:
    """A theme. Names say what a colour is for."""

    name: ThemeName
    ground: str
    surface: str
    raised: str
    line: str
    text: str
    muted: str
    accent: str
    on_accent: str
    good: str
    warning: str
    bad: str
    rotation: str
    velocity: str
    eav: str
    crt: str
    bound: str
    theory: str
    lvdt: str
    wire: str
    accelerometer: str
    tiltmeter: str
    auxiliary: str
    points: float = 10.0
    """Base type size: everything that is drawn by hand grows with it."""

    @property
    def scale(self) -> float:
        """Base type size over the usual one: sizes in pixels that hold text are multiplied by it."""
        return self.points / USUAL_POINTS

    def px(self, pixels: float) -> int:
        """A size in pixels of what holds text, at this type size."""
        return round(pixels * self.scale)

    @property
    def axis_style(self) -> dict[str, str]:
        """How the label of an axis is written."""
        return {"color": self.muted, "font-size": f"{0.9 * self.points:.1f}pt"}

    def side_px(self, pixels: float) -> int:
        """Width of a column of fields beside a page's main part: grows by three quarters of the type."""
        return round(pixels * (1.0 + 0.75 * (self.scale - 1.0)))

    def font(self, points: float, *, bold: bool = False) -> QFont:
        """A font that is `points` large at the usual type size, and grows with it."""
        return font(points * self.scale, bold=bold)

    def family(self, family: str) -> str:
        """Colour of a sensor family; auxiliary families share one."""
        return str(getattr(self, AUXILIARY_GROUP if family in AUXILIARY else family))


DARK: Final = Colours(
    name="dark",
    ground="#0e1318",
    surface="#161d24",
    raised="#212a33",
    line="#2f3a45",
    text="#eaf0f5",
    muted="#93a1ae",
    accent="#3d9bff",
    on_accent="#04121f",
    good="#46c466",
    warning="#f0b429",
    bad="#ff6259",
    rotation="#58c4ff",
    velocity="#ffc04d",
    eav="#ff9f45",
    crt="#6fb3ff",
    bound="#b0bac4",
    theory="#c792ea",
    lvdt="#58c4ff",
    wire="#5fd3a2",
    accelerometer="#ffb357",
    tiltmeter="#d39bf5",
    auxiliary="#d7c8a0",
)

LIGHT: Final = Colours(
    name="light",
    ground="#eff2f5",
    surface="#ffffff",
    raised="#e6ebf0",
    line="#c9d2da",
    text="#11181f",
    muted="#566270",
    accent="#0a63c2",
    on_accent="#ffffff",
    good="#18793a",
    warning="#9a5b00",
    bad="#c4261d",
    rotation="#0a63c2",
    velocity="#b35900",
    eav="#c24e00",
    crt="#0a63c2",
    bound="#5a6672",
    theory="#7d3fb5",
    lvdt="#0a63c2",
    wire="#0b7a55",
    accelerometer="#b35900",
    tiltmeter="#7d3fb5",
    auxiliary="#6b5a1f",
)

THEMES: Final[dict[str, Colours]] = {"dark": DARK, "light": LIGHT}


def font(points: float, *, bold: bool = False, mono: bool = False) -> QFont:
    """A font of the window's families, with digits that all have one width."""
    result = QFont()
    result.setFamilies(MONO_FAMILIES if mono else FONT_FAMILIES)
    result.setPointSizeF(points)
    result.setWeight(QFont.Weight.DemiBold if bold else QFont.Weight.Normal)
    result.setFeature(QFont.Tag("tnum"), 1)
    return result


def apply_theme(app: QApplication, window: QWidget, colours: Colours, base_points: float) -> None:
    """Give a window `colours` and a base type size, and the application the palette for what Qt draws itself.

    The style sheet belongs to the window: on the application it would be worked out anew for every
    widget of every window.
    """
    if app.style().name() != "fusion":
        app.setStyle("Fusion")
    app.setFont(font(base_points))
    # The application's font reaches a window that is not shown yet only in part, once it has a style sheet.
    window.setFont(font(base_points))
    palette = QPalette()
    roles = QPalette.ColorRole
    for role, colour in {
        roles.Window: colours.ground,
        roles.WindowText: colours.text,
        roles.Base: colours.surface,
        roles.AlternateBase: colours.raised,
        roles.Text: colours.text,
        roles.Button: colours.raised,
        roles.ButtonText: colours.text,
        roles.Highlight: colours.accent,
        roles.HighlightedText: colours.on_accent,
        roles.ToolTipBase: colours.raised,
        roles.ToolTipText: colours.text,
        roles.PlaceholderText: colours.muted,
        roles.Mid: colours.line,
    }.items():
        palette.setColor(role, QColor(colour))
    for role in (roles.Text, roles.ButtonText, roles.WindowText):
        palette.setColor(QPalette.ColorGroup.Disabled, role, QColor(colours.muted))
    app.setPalette(palette)
    window.setStyleSheet(_stylesheet(colours, base_points))


def _stylesheet(c: Colours, base: float) -> str:
    return _text_rules(c, base) + _button_rules(c, base) + _entry_rules(c, base) + _bar_rules(c)


def _text_rules(c: Colours, base: float) -> str:
    """Frames, and labels by role and scale."""
    return f"""
    QToolTip {{ background: {c.raised}; color: {c.text}; border: 1px solid {c.line}; padding: 4px; }}
    QFrame#card {{ background: {c.surface}; border: 1px solid {c.line}; border-radius: 6px; }}
    QFrame#bar {{ background: {c.surface}; border: none; }}
    QLabel[scale="state"] {{ font-size: {base * 2.1:.1f}pt; font-weight: 600; }}
    QLabel[scale="verdict"] {{ font-size: {base * 1.9:.1f}pt; font-weight: 600; }}
    QLabel[scale="name"] {{ font-size: {base * 1.5:.1f}pt; font-weight: 600; }}
    QLabel[role="muted"] {{ color: {c.muted}; }}
    QLabel[role="title"] {{ font-size: {base * 1.7:.1f}pt; font-weight: 600; }}
    QLabel[role="heading"] {{ color: {c.muted}; font-size: {base * 0.95:.1f}pt; font-weight: 600; }}
    QLabel[role="good"] {{ color: {c.good}; font-weight: 600; }}
    QLabel[role="warning"] {{ color: {c.warning}; font-weight: 600; }}
    QLabel[role="bad"] {{ color: {c.bad}; font-weight: 600; }}
    """


def _button_rules(c: Colours, base: float) -> str:
    return f"""
    QPushButton {{ background: {c.raised}; border: 1px solid {c.line}; border-radius: 5px;
        padding: 6px 12px; min-height: {max(20, round(base * 1.65))}px; }}
    QPushButton:hover {{ border-color: {c.accent}; }}
    QPushButton:focus {{ border: 2px solid {c.accent}; padding: 5px 11px; }}
    QPushButton:disabled {{ color: {c.muted}; background: {c.ground}; }}
    QPushButton:checked {{ background: {c.accent}; color: {c.on_accent}; border-color: {c.accent}; }}
    QPushButton[role="primary"] {{ background: {c.accent}; color: {c.on_accent}; border-color: {c.accent};
        font-weight: 600; }}
    QPushButton[role="primary"]:disabled {{ background: {c.raised}; color: {c.muted};
        border-color: {c.line}; }}
    QPushButton[role="danger"] {{ color: {c.bad}; border-color: {c.bad}; font-weight: 600; }}
    QPushButton[role="danger"]:disabled {{ color: {c.muted}; border-color: {c.line}; }}
    QPushButton[role="danger"]:checked {{ background: {c.bad}; color: {c.ground}; }}
    QPushButton[role="nav"] {{ background: transparent; border: none; border-left: 4px solid transparent;
        border-radius: 0; text-align: left; padding: 10px 10px; color: {c.muted}; font-weight: 600; }}
    QPushButton[role="nav"]:hover {{ color: {c.text}; }}
    QPushButton[role="nav"]:checked {{ color: {c.text}; background: {c.raised};
        border-left: 4px solid {c.accent}; }}
    QPushButton[role="flat"] {{ background: transparent; border: 1px solid {c.line}; padding: 2px 8px; }}
    QPushButton[role="flat"]:checked {{ background: {c.raised}; color: {c.text}; border-color: {c.accent}; }}
    """


def _entry_rules(c: Colours, base: float) -> str:
    """Tables, lists, trees, and fields to type in."""
    return f"""
    QTableView {{ background: {c.surface}; border: 1px solid {c.line}; border-radius: 6px;
        gridline-color: {c.line}; selection-background-color: {c.raised}; selection-color: {c.text}; }}
    QTableView::item {{ padding: 0 6px; }}
    QHeaderView {{ font-size: {base:.1f}pt; background: {c.surface}; border: none;
        border-bottom: 1px solid {c.line}; }}
    QHeaderView::section {{ background: {c.surface}; color: {c.muted}; border: none; padding: 5px 6px;
        font-weight: 600; }}
    QTableView QTableCornerButton::section {{ background: {c.surface}; border: none; }}
    QLineEdit, QComboBox, QPlainTextEdit, QTextBrowser, QListWidget, QTreeWidget {{ background: {c.surface};
        border: 1px solid {c.line}; border-radius: 5px; padding: 4px 6px; }}
    QLineEdit:focus, QComboBox:focus, QPlainTextEdit:focus {{ border-color: {c.accent}; }}
    QListWidget::item, QTreeWidget::item, QComboBox QAbstractItemView::item {{ min-height: {c.px(20)}px; }}
    QComboBox {{ combobox-popup: 0; }}
    QComboBox QAbstractItemView {{ background: {c.surface}; border: 1px solid {c.line};
        selection-background-color: {c.accent}; selection-color: {c.on_accent}; }}
    QAbstractItemView::indicator, QCheckBox::indicator {{ width: 13px; height: 13px; border-radius: 3px;
        border: 1px solid {c.muted}; }}
    QAbstractItemView::indicator:checked, QCheckBox::indicator:checked {{ background: {c.accent};
        border-color: {c.accent}; }}
    QAbstractItemView::indicator:indeterminate {{ background: {c.line}; }}
    """


def _bar_rules(c: Colours) -> str:
    """Progress, splitters and scroll bars."""
    return f"""
    QProgressBar {{ background: {c.raised}; border: none; border-radius: 4px; }}
    QProgressBar::chunk {{ background: {c.accent}; border-radius: 4px; }}
    QSplitter::handle {{ background: {c.ground}; }}
    QSplitter::handle:hover {{ background: {c.line}; }}
    QScrollBar:vertical {{ background: transparent; width: 10px; }}
    QScrollBar::handle:vertical {{ background: {c.line}; border-radius: 5px; min-height: 24px; }}
    QScrollBar:horizontal {{ background: transparent; height: 10px; }}
    QScrollBar::handle:horizontal {{ background: {c.line}; border-radius: 5px; min-width: 24px; }}
    QScrollBar::add-line, QScrollBar::sub-line {{ width: 0; height: 0; }}
    """

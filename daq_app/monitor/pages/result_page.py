"""The result of a test: r by both estimators, the verdict, and the comparison with its level."""

from __future__ import annotations

import threading
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QHBoxLayout,
    QHeaderView,
    QPushButton,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from daq_app.campaign.result.report import METHODS, period_deviation, repetition_rows, verdict_sentence
from daq_app.campaign.result.result import NoResult, Result, load_result
from daq_app.config.wording import plus_minus
from daq_app.guarded import end_guarded, start_guarded
from daq_app.monitor.data.background import Background
from daq_app.monitor.plots.result_plots import ResultPlots
from daq_app.monitor.widgets.banner import Banner, keyed_button, open_outside
from daq_app.monitor.widgets.labels import DASH, Tile, number, set_role
from daq_app.monitor.widgets.theme import DARK, Colours

_LIMIT_S = 300.0
_HEADER_PX, _ROW_PX, _VISIBLE_ROWS = 38, 23, 5


def analyse(run: Path) -> Result:
    """The saved result of a run, else a new one made in a process of its own. Raises `NoResult`."""
    saved = load_result(run)
    if saved is not None and run.with_suffix(".result.pdf").exists():
        return saved
    process = start_guarded("daq_app.campaign.result.result", [str(run)])
    late = threading.Timer(_LIMIT_S, process.kill)
    late.start()
    try:
        assert process.stdout is not None
        said = process.stdout.read()  # to its end; `communicate` would close its input, which ends it
        if process.wait():
            raise NoResult(said.strip() or f"The analysis of {run.name} ended without a word.")
    finally:
        late.cancel()
        end_guarded(process)
    made = load_result(run)
    if made is None:
        raise NoResult(f"The result of {run.name} could not be read back.")
    return made


class ResultPage(QWidget):
    """Emits `told(severity, text)`, `replay(path)`, `judge(path, verdict)` and `next_wanted`."""

    told = Signal(str, str)
    replay = Signal(str)
    judge = Signal(str, str)
    next_wanted = Signal()
    shown = Signal()

    def __init__(self, background: Background, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._background = background
        self._colours = DARK
        self.run: Path | None = None
        self.result: Result | None = None
        self.banner = Banner("No test yet", "The result appears here after a test.", points=22)
        self._sign, self._title, (self._verdict,) = (
            self.banner.sign,
            self.banner.title,
            self.banner.sentences,
        )
        self.tiles = {
            "theta0": Tile("θ0/α", 19),
            "impacts": Tile("Impacts", 19),
            "EAV": Tile("r by EAV", 19),
            "CRT": Tile("r by CRT", 19),
            "periods": Tile("Periods against (4.1)", 19),
        }
        self.plots = ResultPlots()
        self.table = QTableWidget(0, 6)
        self.table.setHorizontalHeaderLabels(["Test", "θ0/α", "Impacts", "r EAV", "r CRT", "Verdict"])
        self.table.verticalHeader().hide()
        self.table.verticalHeader().setDefaultSectionSize(_ROW_PX)
        self.table.setShowGrid(False)
        self.table.horizontalHeader().setDefaultAlignment(
            Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
        )
        self.table.setEditTriggers(QTableWidget.EditTrigger.NoEditTriggers)
        self.table.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Stretch)
        self.buttons = {
            "page": keyed_button(self, "Page", "Ctrl+O", self._open_page),
            "replay": keyed_button(self, "Replay", "Ctrl+P", lambda: self.replay.emit(str(self.run))),
            "good": keyed_button(self, "Good", "Ctrl+G", lambda: self.judge.emit(str(self.run), "good")),
            "bad": keyed_button(self, "Repeat it", "Ctrl+R", lambda: self.judge.emit(str(self.run), "bad")),
            "next": QPushButton("Next test  F6"),
        }
        self.buttons["next"].setProperty("role", "primary")
        self._build()
        self.buttons["next"].clicked.connect(self.next_wanted.emit)
        self._show_buttons()

    def _build(self) -> None:
        self.banner.add_buttons(*self.buttons.values())
        tiles = QHBoxLayout()
        tiles.setSpacing(6)
        for tile in self.tiles.values():
            tiles.addWidget(tile, 1)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(10, 8, 10, 8)
        layout.setSpacing(6)
        layout.addWidget(self.banner)
        layout.addLayout(tiles)
        layout.addWidget(self.plots, 1)
        layout.addWidget(self.table)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        self.table.verticalHeader().setDefaultSectionSize(colours.px(_ROW_PX))
        self._fit_table()
        self.plots.restyle(colours)
        self._show_verdict()

    def open(self, run: Path, *, soon: bool = False) -> None:
        """Show the result of a run; it is analysed in another process if it has none yet.

        `soon`: the recorder is making the result; `open_if_shown` is called when it is there.
        """
        self.run, self.result = run, None
        self._title.setText(run.stem.split("_")[0])
        self._verdict.setText("The run is being analysed …")
        set_role(self._verdict, "muted")
        self._sign.show_shape("ring", self._colours.muted)
        self.plots.show_result(None)
        self.table.setRowCount(0)
        for tile in self.tiles.values():
            tile.show_value(DASH)
        self._show_buttons()
        if not soon:
            self._background.run(
                lambda: analyse(run), lambda result: self._show(run, result), self._on_trouble
            )

    def open_if_shown(self, run: Path) -> None:
        """The recorder has made the result of a run, or says that there is none."""
        if self.run is not None and run.name == self.run.name and self.result is None:
            self.open(self.run)

    def _on_trouble(self, error: Exception) -> None:
        if not isinstance(error, (NoResult, OSError)):
            raise error
        self._verdict.setText(str(error))
        set_role(self._verdict, "warning")
        self._sign.show_shape("triangle", self._colours.warning)
        self.told.emit("warning", str(error))

    def _show(self, run: Path, result: Result) -> None:
        if run != self.run:
            return  # another one was asked for meanwhile
        self.result = result
        test = result.test
        self._title.setText(test.test)
        self.tiles["theta0"].show_value(number(test.phi0, 3), f"{number(1e3 * test.theta0_rad, 1)} mrad")
        self.tiles["impacts"].show_value(str(len(test.impacts_s)))
        for name in METHODS:
            method = test.methods.get(name)
            if method is None:
                self.tiles[name].show_value(DASH, "too few impacts")
                continue
            detail = f"{plus_minus(method.standard_error)} · {method.r / test.r_max:.2f} r_max"
            self.tiles[name].show_value(f"{method.r:.3f}", detail)
        deviation = period_deviation(test)
        shown = DASH if deviation is None else f"{number(100 * deviation, 1)} %"
        self.tiles["periods"].show_value(shown, "mean deviation from theory")
        self.plots.show_result(result)
        self._fill_table(result)
        self._show_verdict()
        self._show_buttons()
        self.shown.emit()

    def _fit_table(self) -> None:
        """As high as its rows need, up to some."""
        rows = min(self.table.rowCount(), _VISIBLE_ROWS)
        self.table.setFixedHeight(self._colours.px(_HEADER_PX + _ROW_PX * rows))

    def _fill_table(self, result: Result) -> None:
        rows = repetition_rows(result.test, result.earlier)
        self.table.setRowCount(len(rows))
        self._fit_table()
        for place, row in enumerate(rows):
            values = [DASH if row.r[name] is None else f"{row.r[name]:.4f}" for name in METHODS]
            name = f"{row.test}   (this test)" if row.this else row.test
            cells = [name, f"{row.phi0:.4f}", str(row.impacts), *values, "good" if row.good else "not good"]
            for column, text in enumerate(cells):
                item = QTableWidgetItem(text)
                item.setFlags(item.flags() & ~Qt.ItemFlag.ItemIsEditable)
                if row.this:
                    item.setFont(self._colours.font(10, bold=True))
                self.table.setItem(place, column, item)
        self.table.scrollToBottom()

    def _show_verdict(self) -> None:
        if self.result is None:
            self._sign.show_shape("ring", self._colours.muted)
            return
        test = self.result.test
        role = "good" if test.good and not test.reasons else "warning" if test.good else "bad"
        shape = {"good": "tick", "warning": "triangle", "bad": "cross"}[role]
        self._sign.show_shape(shape, str(getattr(self._colours, role)))
        self._verdict.setText(verdict_sentence(test))
        set_role(self._verdict, role)

    def _show_buttons(self) -> None:
        for name, button in self.buttons.items():
            button.setEnabled(name == "next" or self.result is not None)

    def _open_page(self) -> None:
        if self.run is not None:
            page = self.run.with_suffix(".result.html")
            if not open_outside(page):
                self.told.emit("warning", f"No program on this computer opens pages: {page}")

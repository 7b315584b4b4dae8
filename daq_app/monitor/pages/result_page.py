"""The result of a test: r by both estimators, the verdict, and the comparison with its level."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import QDateTime, Qt, Signal
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QComboBox, QFrame, QHBoxLayout, QPushButton, QScrollArea, QVBoxLayout, QWidget

from daq_app.campaign.recorded import read_recorded
from daq_app.campaign.result.motions import period_deviation
from daq_app.campaign.result.result import NoResult, Result, load_result, page_is_current
from daq_app.campaign.result.words import METHODS, verdict_sentence
from daq_app.campaign.status import NO_FACTS, RecordedTest
from daq_app.config import ConfigError
from daq_app.config.wording import plus_minus
from daq_app.monitor.data.background import Background
from daq_app.monitor.data.child import said_by
from daq_app.monitor.look.labels import DASH, Tile, number, set_role
from daq_app.monitor.look.theme import DARK, Colours
from daq_app.monitor.plots.result_plots import ResultPlots
from daq_app.monitor.widgets.banner import Banner, keyed_button
from daq_app.monitor.widgets.family_table import FamilyTable
from daq_app.monitor.widgets.level_table import LevelTable
from daq_app.monitor.widgets.opening import open_outside
from daq_app.monitor.widgets.run_notes import show_notes
from daq_app.runfile import RunFileError
from daq_app.runfile.folder import RUN_SUFFIX


def analyse(run: Path) -> Result:
    """The saved result of a run, else a new one made in a process of its own. Raises `NoResult`."""
    saved = load_result(run)
    if saved is not None and page_is_current(run):
        return saved
    ok, said = said_by("daq_app.campaign.result.result", [str(run)])
    if not ok:
        raise NoResult(said or f"The analysis of {run.name} ended without a word.")
    made = load_result(run)
    if made is None:
        raise NoResult(f"The result of {run.name} could not be read back.")
    return made


class NoRecord(Exception):
    """The record of a run could not be made: why, in words."""


def make_record(run: Path) -> Path:
    """Make the test record of a run under a name that is free; a signed one is never replaced."""
    out = free_name(run.with_suffix(".record.pdf"))
    ok, said = said_by("daq_app.campaign.record.write", [str(run), str(out)])
    if not ok:
        raise NoRecord(said or f"The record of {run.name} could not be made.")
    return out


def free_name(path: Path) -> Path:
    """The path, or one with a number before its suffixes that no file has."""
    stem, _, suffixes = path.name.partition(".record")
    candidates = (path.with_name(f"{stem}.record-{n}{suffixes}") for n in itertools.count(2))
    return path if not path.exists() else next(one for one in candidates if not one.exists())


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
        self._making = False
        """A record is being made."""
        self._folder: Path | None = None
        """The one whose tests are offered."""
        self.run: Path | None = None
        self.result: Result | None = None
        self.banner = Banner("No test yet", "The result appears here after a test.", "", points=22)
        self._sign, self._title, (self._verdict, self.notes) = (
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
        self.families = FamilyTable()
        self.table = LevelTable()
        self.table.ticked.connect(self._lay_over)
        self.table.opened.connect(self._open_sibling)
        self.chooser = QComboBox()
        self.chooser.setToolTip("Any test of this folder, the newest first")
        self.chooser.setPlaceholderText("Choose a test of this folder")
        self.chooser.activated.connect(self._open_chosen)
        self.buttons = {
            "record": keyed_button(self, "Record", "Ctrl+J", self._make_record),
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
        layout.addWidget(self.chooser)
        layout.addWidget(self.banner)
        layout.addLayout(tiles)
        layout.addWidget(self._lower_part(), 1)

    def _lower_part(self) -> QScrollArea:
        """Plots and tables; in large type on a small screen there is more of them than fits."""
        tables = QHBoxLayout()
        tables.setSpacing(6)
        for table, share in ((self.table, 5), (self.families, 7)):
            tables.addWidget(table, share, Qt.AlignmentFlag.AlignTop)
        content = QWidget()
        layout = QVBoxLayout(content)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(6)
        layout.addWidget(self.plots, 1)
        layout.addLayout(tables)
        area = QScrollArea()
        area.setWidget(content)
        area.setWidgetResizable(True)
        area.setFrameShape(QFrame.Shape.NoFrame)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        return area

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        self.table.restyle(colours)
        self.families.restyle(colours)
        self.plots.restyle(colours)
        self._show_verdict()

    def showEvent(self, event: QShowEvent) -> None:
        """The page comes to the front with the tests that are in the folder now."""
        super().showEvent(event)
        if self._folder is not None:
            self.list_tests(self._folder)

    def open(self, run: Path, *, soon: bool = False) -> None:
        """Show the result of a run; it is analysed in another process if it has none yet.

        `soon`: the recorder is making the result; `open_if_shown` is called when it is there.
        """
        self.run, self.result = run, None
        self._title.setText(run.stem.split("_")[0])
        self._verdict.setText("The run is being analysed …")
        show_notes(self.notes, NO_FACTS)
        set_role(self._verdict, "muted")
        self._sign.show_shape("ring", self._colours.muted)
        self.plots.show_result(None)
        self.table.clear_rows()
        self.families.show_test(None)
        if self.chooser.findData(str(run)) < 0:
            self.list_tests(run.parent)
        self._mark_chosen()
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
        if not isinstance(error, (NoResult, ConfigError, RunFileError, OSError)):
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
        show_notes(self.notes, result.facts)
        deviation = period_deviation(test)
        shown = DASH if deviation is None else f"{number(100 * deviation, 1)} %"
        self.tiles["periods"].show_value(shown, "mean deviation from theory")
        self.plots.show_result(result)
        self.table.show_result(result)
        self.families.show_test(test)
        self._show_verdict()
        self._show_buttons()
        self.shown.emit()

    # -- past tests and repetitions ------------------------------------------------------------------

    def list_tests(self, folder: Path) -> None:
        """Offer every recorded test of a folder, the newest first."""
        self._folder = folder
        self._background.run(
            lambda: read_recorded(folder) if folder.is_dir() else [], self._on_listed, self._on_trouble
        )

    def _on_listed(self, tests: Sequence[RecordedTest]) -> None:
        self.chooser.clear()
        for test in sorted(tests, key=lambda test: -test.released_ns):
            if test.path is not None and test.path.suffix == RUN_SUFFIX:
                at = QDateTime.fromMSecsSinceEpoch(test.released_ns // 10**6).toString("yyyy-MM-dd HH:mm")
                self.chooser.addItem(f"{test.name}   {at}   {test.verdict.value}", str(test.path))
        self._mark_chosen()

    def _mark_chosen(self) -> None:
        self.chooser.setCurrentIndex(self.chooser.findData(str(self.run)))

    def _open_chosen(self, row: int) -> None:
        self.open(Path(str(self.chooser.itemData(row))))

    def _open_sibling(self, name: str) -> None:
        if self.run is not None and name != self.run.name:
            self.open(self.run.with_name(name))

    def _lay_over(self) -> None:
        self.plots.show_result(self.result, self.table.over)

    def _make_record(self) -> None:
        """Make the record for signature in another process, and show it."""
        run = self.run
        if run is None or self._making:
            return
        self._making = True
        self._show_buttons()
        self.told.emit("info", f"The record of {run.stem} is being made …")
        self._background.run(lambda: make_record(run), self._on_record, self._on_record)

    def _on_record(self, made: Path | Exception) -> None:
        self._making = False
        self._show_buttons()
        if isinstance(made, (NoRecord, OSError)):
            self.told.emit("error", str(made))
        elif isinstance(made, Exception):
            raise made
        else:
            self.told.emit("info", f"The test record is saved as {made}")
            open_outside(self, made)

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
        self.buttons["record"].setEnabled(self.run is not None and not self._making)

    def _open_page(self) -> None:
        if self.run is not None:
            open_outside(self, self.run.with_suffix(".result.html"))

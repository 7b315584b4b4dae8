"""Where simulator and wall differ: a diagnosis of chosen runs, made beside the tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QListWidget,
    QListWidgetItem,
    QProgressBar,
    QVBoxLayout,
    QWidget,
)

from daq_app.campaign.recorded import read_recorded
from daq_app.campaign.status import RecordedTest, TestVerdict
from daq_app.config import ConfigError
from daq_app.config.shown_text import shortened
from daq_app.gap.files import newest_result
from daq_app.gap.words import causes_in_words, closed_share
from daq_app.monitor.data.background import Background
from daq_app.monitor.data.gap_runner import GapRunner
from daq_app.monitor.look.labels import number, role_label, set_role, tip_text
from daq_app.monitor.look.theme import DARK, Colours
from daq_app.monitor.plots.gap_traces import GapTraces
from daq_app.monitor.plots.gap_views import BarRows, GapMapView, closure_bars, evidence_bars, map_cells
from daq_app.monitor.widgets.banner import Banner, keyed_button
from daq_app.monitor.widgets.opening import open_outside
from daq_app.runfile import RunFileError

_PATH = Qt.ItemDataRole.UserRole
_SPECIMEN = Qt.ItemDataRole.UserRole + 1
LOOKS = {
    "effect": ("tick", "good", "An effect explains the gap"),
    "pair": ("tick", "good", "Two effects explain the gap"),
    "parameters": ("tick", "good", "Other parameter values close the gap"),
    "nothing_missing": ("tick", "good", "Nothing is missing"),
    "cannot_tell": ("triangle", "warning", "It cannot be told"),
    "none_of_these": ("triangle", "warning", "None of the known effects"),
    "below_detection": ("triangle", "warning", "Below detection"),
}


class GapPage(QWidget):
    """Emits `told(severity, text)`; `shown` when a result has been drawn."""

    told = Signal(str, str)
    shown = Signal()

    def __init__(self, background: Background, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._background = background
        self._colours = DARK
        self._recording = False
        self.folder: Path | None = None
        self.result: dict[str, Any] | None = None
        self._result_file: Path | None = None
        self.runner = GapRunner(background, self)
        self.banner = Banner(
            "No diagnosis yet", "Choose runs of one specimen, several levels if there are.", "", points=19
        )
        self._sign, self._title = self.banner.sign, self.banner.title
        self._sentence, self._more = self.banner.sentences
        self.runs = QListWidget()
        self.runs.itemChanged.connect(lambda _item: self._show_buttons())
        self.after_test = QCheckBox("Diagnose after every test")
        self.progress = QProgressBar()
        self.progress.setTextVisible(False)
        self.progress.setFixedHeight(8)
        self._progress_text = role_label("", "muted")
        self.buttons = {
            "start": keyed_button(self, "Diagnose", "Ctrl+B", self.start),
            "stop": keyed_button(self, "Stop", "Ctrl+K", self.runner.stop),
            "page": keyed_button(self, "Open the page", "Ctrl+O", self._open_page),
        }
        self.buttons["start"].setProperty("role", "primary")
        self.map = GapMapView()
        self.traces = GapTraces()
        self.evidence = BarRows()
        self.closure = BarRows()
        self._build()
        self.runner.progress.connect(self._on_progress)
        self.runner.finished.connect(lambda path: self._on_finished(Path(path)))
        self.runner.failed.connect(self._on_failed)
        self._show_buttons()

    def _build(self) -> None:
        self.banner.add_buttons(self.buttons["page"])
        left = QVBoxLayout()
        left.setSpacing(6)
        left.addWidget(role_label("Runs", "heading"))
        left.addWidget(self.runs, 1)
        left.addWidget(self.after_test)
        left.addWidget(self._progress_text)
        left.addWidget(self.progress)
        buttons = QHBoxLayout()
        buttons.addWidget(self.buttons["start"], 1)
        buttons.addWidget(self.buttons["stop"])
        left.addLayout(buttons)
        holder = QWidget()
        holder.setLayout(left)
        left.setContentsMargins(0, 0, 0, 0)
        self._holder = holder
        pictures = QGridLayout()
        pictures.setSpacing(6)
        for place, (title, widget) in enumerate(
            (
                ("Where: largest gap before → after; 1 is noise and scatter", self.map),
                ("Measured and simulated", self.traces),
                ("Which: evidence, the best first", self.evidence),
                ("How far: gap on runs not used for the fit, by level", self.closure),
            )
        ):
            pictures.addWidget(self._card(title, widget), *divmod(place, 2))
        pictures.setRowStretch(0, 1)
        pictures.setRowStretch(1, 1)
        below = QHBoxLayout()
        below.setSpacing(12)
        below.addWidget(holder)
        below.addLayout(pictures, 1)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(10, 8, 10, 8)
        layout.setSpacing(8)
        layout.addWidget(self.banner)
        layout.addLayout(below, 1)

    @staticmethod
    def _card(title: str, content: QWidget) -> QFrame:
        frame = QFrame()
        frame.setObjectName("card")
        layout = QVBoxLayout(frame)
        layout.setContentsMargins(12, 8, 12, 10)
        heading = role_label(title, "heading")
        heading.setWordWrap(True)
        layout.addWidget(heading)
        layout.addWidget(content, 1)
        return frame

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        self._holder.setFixedWidth(colours.side_px(310))
        for view in (self.map, self.traces, self.evidence, self.closure):
            view.restyle(colours)
        self._show_verdict()

    # -- runs ------------------------------------------------------------------------------------

    def set_folder(self, folder: Path) -> None:
        """List the releases in a folder, and show the newest diagnosis in it."""
        if not folder.is_dir():
            return
        first = folder != self.folder
        self.folder = folder
        self._background.run(
            lambda: (read_recorded(folder), newest_result(folder) if first else None),
            lambda found: self._on_listed(*found),
            self._on_unlisted,
        )

    def list_again(self) -> None:
        """A verdict may have changed: what was rejected leaves the diagnosis."""
        if self.folder is not None:
            self.set_folder(self.folder)

    def _on_listed(self, tests: Sequence[RecordedTest], saved: Path | None) -> None:
        chosen, known = set(self.chosen), {self._path(i) for i in range(self.runs.count())}
        self.runs.blockSignals(True)
        self.runs.clear()
        for test in sorted(tests, key=lambda test: test.released_ns):
            if test.path is None or test.path.suffix != ".h5":
                continue
            item = QListWidgetItem(f"{test.name}   {test.verdict.value}")
            item.setData(_PATH, str(test.path))
            item.setData(_SPECIMEN, test.name.specimen)
            good = test.verdict in (TestVerdict.GOOD, TestVerdict.UNCHECKED)
            item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
            if not good:
                item.setFlags(item.flags() & ~Qt.ItemFlag.ItemIsEnabled)
                item.setToolTip(tip_text(shortened(test.reason, 200)))
            # A test that was rejected since it was ticked leaves the diagnosis.
            wanted = good and (test.path in chosen if test.path in known else True)
            item.setCheckState(Qt.CheckState.Checked if wanted else Qt.CheckState.Unchecked)
            self.runs.addItem(item)
        self.runs.blockSignals(False)
        self._show_buttons()
        if saved is not None and self.result is None and not self.runner.busy:
            self._on_finished(saved)

    def _on_unlisted(self, error: Exception) -> None:
        if not isinstance(error, (ConfigError, RunFileError, OSError)):
            raise error
        self.told.emit("error", f"The runs cannot be listed: {error}")

    def _path(self, row: int) -> Path:
        return Path(str(self.runs.item(row).data(_PATH)))

    @property
    def chosen(self) -> list[Path]:
        """The runs that are ticked."""
        rows = range(self.runs.count())
        return [self._path(i) for i in rows if self.runs.item(i).checkState() is Qt.CheckState.Checked]

    def after_run(self, run: Path) -> None:
        """A run has been closed: list it, and diagnose if that is wanted after every test."""
        self.set_folder(run.parent)
        if self.after_test.isChecked():
            # The list comes back through the same queue: the diagnosis starts when it is there.
            self._background.run(lambda: None, lambda _nothing: self.start(), self._on_unlisted)

    # -- diagnosing ------------------------------------------------------------------------------

    def start(self) -> None:
        """Diagnose the runs that are ticked."""
        runs = self.chosen
        if self._recording:
            self.told.emit("warning", "A test is being recorded: the diagnosis waits for its end.")
            return
        if not runs:
            self.told.emit("info", "Tick the runs to diagnose.")
            return
        self.runner.start(runs)
        self._on_progress(0, 0, f"{len(runs)} runs: starting")
        self._show_buttons()

    def set_recording(self, recording: bool) -> None:
        """While a test is recorded the processor is its own: a diagnosis under way is stopped."""
        if recording and not self._recording and self.runner.busy:
            self.runner.stop()
            self.told.emit(
                "info", "The diagnosis was stopped: a test is being recorded. Start it again after."
            )
        self._recording = recording
        self._show_buttons()

    def close_down(self) -> None:
        """The window closes: nothing goes on without it."""
        self.runner.stop()

    def _on_progress(self, done: int, total: int, text: str) -> None:
        self.progress.setRange(0, total)
        self.progress.setValue(done)
        self._progress_text.setText(f"{text[:1].upper()}{text[1:]} …")

    def _on_finished(self, path: Path) -> None:
        self._rest("")
        self._background.run(lambda: _read(path), lambda result: self._show(path, result), self._on_unread)

    def _on_unread(self, error: Exception) -> None:
        if not isinstance(error, ValueError):
            raise error
        self.told.emit("error", str(error))

    def _show(self, path: Path, result: dict[str, Any]) -> None:
        self.result, self._result_file = result, path
        self.map.show_cells(map_cells(self.result))
        self.traces.show_traces(self.result.get("notes", {}).get("traces", []))
        self.evidence.show_bars(evidence_bars(self.result))
        self.closure.show_bars(closure_bars(self.result))
        self._show_verdict()
        self._show_buttons()
        self.shown.emit()

    def _on_failed(self, text: str) -> None:
        self._rest(text)
        if text:
            self.told.emit("info" if "stopped" in text else "warning", text)

    def _rest(self, text: str) -> None:
        self.progress.setRange(0, 1)
        self.progress.setValue(0)
        self._progress_text.setText(text)
        self._progress_text.setWordWrap(True)
        self._show_buttons()

    # -- showing ---------------------------------------------------------------------------------

    def _show_verdict(self) -> None:
        result = self.result
        if result is None:
            self._sign.show_shape("ring", self._colours.muted)
            return
        shape, role, title = LOOKS.get(str(result["decision"]), ("ring", "muted", str(result["decision"])))
        self._sign.show_shape(shape, str(getattr(self._colours, role)))
        self._title.setText(title)
        set_role(self._title, role)
        self._sentence.setText(str(result["decision_detail"]["sentence"]))
        set_role(self._sentence, "")
        causes = causes_in_words(result.get("causes") or [])
        parts = [f"In words: {'; '.join(causes)}."] if causes else []
        parts.append(str(result["where"]["sentence"]))
        if gap := result.get("gap"):
            parts.append(gap_in_words(gap))
        parts.append(f"Measure next: {result['next_measurement']}")
        parts.append(f"From {len(result['runs'])} runs: {', '.join(result['runs'][:8])}.")
        parts += [f"Limit: {limit}" for limit in result["limits"][:2]]
        self._more.setText(" ".join(parts))

    def _show_buttons(self) -> None:
        self.buttons["start"].setEnabled(bool(self.chosen) and not self.runner.busy and not self._recording)
        self.buttons["stop"].setEnabled(self.runner.busy)
        self.buttons["page"].setEnabled(self._result_file is not None)

    def _open_page(self) -> None:
        if self._result_file is not None:
            open_outside(self, self._result_file.with_suffix(".html"))


def gap_in_words(gap: dict[str, Any]) -> str:
    """The gap on held-out runs before and after the causes; a share only where a gap was there to close."""
    change = f"{number(gap['before'], 2)} → {number(gap['after'], 2)}"
    figures = f"Gap on held-out runs {change} (1 is noise and scatter)"
    if gap["before"] <= 1.0:
        return f"{figures}: there was none to close."
    return f"{figures}, {closed_share(gap['closure'])} of it closed."


def _read(path: Path) -> dict[str, Any]:
    """The result in a file. Raises `ValueError` in words."""
    # Imported in the background: the window starts without SciPy's statistics.
    from daq_app.gap.apply import read_result
    from daq_app.gap.core import CannotDiagnose

    try:
        return read_result(path)
    except CannotDiagnose as trouble:
        raise ValueError(str(trouble)) from None

"""Replay of any run: pick channels, zoom, read values at the cursor, save the picture or the data."""

from __future__ import annotations

import math
from pathlib import Path

import pyqtgraph.exporters
from PySide6.QtCore import QPoint, QRect, QRectF, Qt, Signal
from PySide6.QtGui import QBrush, QColor, QKeySequence, QPainter, QShortcut
from PySide6.QtSvg import QSvgGenerator
from PySide6.QtWidgets import (
    QFileDialog,
    QHBoxLayout,
    QHeaderView,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QSplitter,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from daq_app.config.families import AUXILIARY
from daq_app.monitor.data.background import Background
from daq_app.monitor.data.replay_data import ROTATION, VELOCITY, ReplayRun
from daq_app.monitor.look.labels import FittedLabel, PlainLabel, number, role_label, tip_text
from daq_app.monitor.look.theme import DARK, Colours
from daq_app.monitor.plots.replay_plots import ReplayPlots, shade
from daq_app.monitor.plots.strip_panel import FAMILY_TITLES
from daq_app.monitor.widgets.run_notes import show_notes
from daq_app.runfile import RunFileError
from daq_app.runfile.durable import written_whole
from daq_app.runfile.folder import require_replaceable

_NAME = Qt.ItemDataRole.UserRole
_WIDEST_VALUE = "−0000.000 mrad  "
"""No value at the cursor is wider."""
_FAMILIES = ("lvdt", "wire", "accelerometer", "tiltmeter")


class ReplayPage(QWidget):
    """Looks at one run at a time; emits `told(severity, text)` and `opened(path)`."""

    told = Signal(str, str)
    opened = Signal(str)

    def __init__(self, background: Background, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._background = background
        self._colours = DARK
        self.run: ReplayRun | None = None
        self.plots = ReplayPlots()
        self._title = role_label("No run is open", "title")
        self._facts = FittedLabel("muted")
        self._facts.setText("Open a run to look at it.")
        self.notes = role_label("", "muted")
        self.notes.setWordWrap(True)
        self.notes.hide()
        self.tree = QTreeWidget()
        self.tree.setHeaderLabels(["Signal", "At the cursor"])
        self.tree.header().setStretchLastSection(False)
        self.tree.header().setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        self.tree.header().setSectionResizeMode(1, QHeaderView.ResizeMode.Fixed)
        self.tree.setIndentation(14)
        self.tree.itemChanged.connect(self._on_item)
        self.events = QListWidget()
        self.events.itemActivated.connect(self._to_event)
        self.events.itemClicked.connect(self._to_event)
        self._time = PlainLabel("")
        self.buttons = {
            "open": QPushButton("Open …  Ctrl+O"),
            "whole": QPushButton("Whole run  Home"),
            "motion": QPushButton("Motion  End"),
            "png": QPushButton("PNG"),
            "svg": QPushButton("SVG"),
            "csv": QPushButton("CSV of the view"),
        }
        for name, key in (("png", "Ctrl+P"), ("svg", "Ctrl+G"), ("csv", "Ctrl+E")):
            self.buttons[name].setToolTip(f"Save what is on screen  ({key})")
        self._build()
        self.plots.cursor_moved.connect(self._on_cursor)
        self.buttons["open"].clicked.connect(self.choose_file)
        self.buttons["whole"].clicked.connect(self.show_whole)
        self.buttons["motion"].clicked.connect(self.show_motion)
        for kind in ("png", "svg", "csv"):
            self.buttons[kind].clicked.connect(lambda _checked=False, k=kind: self._choose_export(k))
        for key, act in (
            ("Ctrl+O", self.choose_file),
            ("Home", self.show_whole),
            ("End", self.show_motion),
            ("Left", lambda: self._step(-1)),
            ("Right", lambda: self._step(1)),
            ("+", lambda: self._zoom(0.5)),
            ("-", lambda: self._zoom(2.0)),
            ("Ctrl+P", lambda: self._choose_export("png")),
            ("Ctrl+G", lambda: self._choose_export("svg")),
            ("Ctrl+E", lambda: self._choose_export("csv")),
        ):
            shortcut = QShortcut(QKeySequence(key), self)
            shortcut.setContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
            shortcut.activated.connect(act)

    def _build(self) -> None:
        top = QHBoxLayout()
        top.addWidget(self._title, 1)
        for button in self.buttons.values():
            top.addWidget(button)
        side = QSplitter(Qt.Orientation.Vertical)
        side.addWidget(self.tree)
        below = QWidget()
        layout = QVBoxLayout(below)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(4)
        layout.addWidget(role_label("Events", "heading"))
        layout.addWidget(self.events)
        side.addWidget(below)
        side.setSizes([600, 200])
        self.splitter = QSplitter(Qt.Orientation.Horizontal)
        left = QWidget()
        left_layout = QVBoxLayout(left)
        left_layout.setContentsMargins(0, 0, 0, 0)
        left_layout.addWidget(self._time)
        left_layout.addWidget(side, 1)
        self.splitter.addWidget(left)
        self.splitter.addWidget(self.plots)
        self.splitter.setSizes([300, 1000])
        self.splitter.setStretchFactor(1, 1)
        whole = QVBoxLayout(self)
        whole.setContentsMargins(10, 8, 10, 8)
        whole.setSpacing(6)
        whole.addLayout(top)
        whole.addWidget(self._facts)
        whole.addWidget(self.notes)
        whole.addWidget(self.splitter, 1)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        self.plots.restyle(colours)
        self._colour_tree()
        self._widen_tree()

    # -- opening ---------------------------------------------------------------------------------

    def choose_file(self) -> None:
        """Ask for a run file; the window stays alive meanwhile."""
        dialog = QFileDialog(self, "Open a run", str(self.run.path.parent if self.run else Path.cwd()))
        dialog.setNameFilter("Runs (*.h5)")
        dialog.setModal(False)
        dialog.fileSelected.connect(lambda name: self.open(Path(name)))
        dialog.show()

    def open(self, path: Path) -> None:
        """Open a run in the background and show it."""
        self._facts.setText(f"Opening {path.name} …")
        self._background.run(lambda: ReplayRun(path), self._show, self._on_trouble)

    def _on_trouble(self, error: Exception) -> None:
        if not isinstance(error, (RunFileError, OSError, MemoryError)):
            raise error
        self._facts.setText("The run could not be opened.")
        self.told.emit("error", str(error))

    def _show(self, run: ReplayRun) -> None:
        if self.run is not None:
            self.run.close()
        self.run = run
        header = run.header
        self._title.setText(header.test or run.path.name)
        start, stop = run.span_s
        missing = sum(gap.n_samples for gap in run.gaps)
        gaps = f" · {missing} samples missing in {len(run.gaps)} gaps" if run.gaps else " · no gap"
        size = f"{stop - start:.1f} s at {run.rate_hz:g} Hz · {len(header.channel_ids)} channels"
        self._facts.setText(f"{run.path.name} · {size}{gaps}")
        self._facts.setToolTip(tip_text(self._facts.text()))
        show_notes(self.notes, run.facts)
        self._fill_tree()
        self._fill_events()
        self.plots.show_run(run, self.chosen)
        self.show_motion()
        self.plots.set_cursor(0.0)
        self.opened.emit(str(run.path))

    def _fill_tree(self) -> None:
        assert self.run is not None
        self.tree.blockSignals(True)
        self.tree.clear()
        titles: dict[str, str] = {"motion": "Motion"}
        titles.update((name, FAMILY_TITLES[name].split(" · ")[0].split(" ")[0]) for name in _FAMILIES)
        titles.update((name, kind.plural.partition(" (")[0].capitalize()) for name, kind in AUXILIARY.items())
        shown = {ROTATION, VELOCITY}
        accelerometers = [s.name for s in self.run.signals.values() if s.family == "accelerometer"]
        shown.update(accelerometers[:1])
        for family, title in titles.items():
            names = [s.name for s in self.run.signals.values() if s.family == family]
            if not names:
                continue
            parent = QTreeWidgetItem([title, ""])
            parent.setFlags(parent.flags() | Qt.ItemFlag.ItemIsAutoTristate | Qt.ItemFlag.ItemIsUserCheckable)
            self.tree.addTopLevelItem(parent)
            for name in names:
                child = QTreeWidgetItem([name, ""])
                child.setData(0, _NAME, name)
                child.setFlags(child.flags() | Qt.ItemFlag.ItemIsUserCheckable)
                child.setCheckState(0, Qt.CheckState.Checked if name in shown else Qt.CheckState.Unchecked)
                child.setTextAlignment(1, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                parent.addChild(child)
            parent.setExpanded(family in ("motion", "accelerometer"))
        self.tree.blockSignals(False)
        self._colour_tree()
        self._widen_tree()

    def _widen_tree(self) -> None:
        """Names and values are whole, whatever the size of the type; values may change without a jump."""
        metrics = self.tree.fontMetrics()
        heading = self.tree.header().sectionSizeHint(1)
        value = max(heading, metrics.horizontalAdvance(_WIDEST_VALUE))
        self.tree.header().resizeSection(1, value)
        frame = 2 * self.tree.frameWidth() + self.tree.verticalScrollBar().sizeHint().width()
        self.tree.setMinimumWidth(self.tree.sizeHintForColumn(0) + value + frame)

    def _fill_events(self) -> None:
        assert self.run is not None
        self.events.clear()
        for event in self.run.events:
            time = self.run.time_of(event.sample - self.run.first_sample)
            item = QListWidgetItem(f"{number(time, 3)} s  {event.kind}")
            item.setData(_NAME, time)
            item.setToolTip(tip_text(event.text))
            self.events.addItem(item)

    # -- choosing --------------------------------------------------------------------------------

    def _items(self) -> list[QTreeWidgetItem]:
        items: list[QTreeWidgetItem | None] = []
        for row in range(self.tree.topLevelItemCount()):
            top = self.tree.topLevelItem(row)
            if top is not None:
                items.extend(top.child(place) for place in range(top.childCount()))
        return [item for item in items if item is not None]

    @property
    def chosen(self) -> list[str]:
        """Names of the signals that are drawn."""
        return [str(i.data(0, _NAME)) for i in self._items() if i.checkState(0) is Qt.CheckState.Checked]

    def choose(self, names: list[str]) -> None:
        """Draw exactly these signals."""
        self.tree.blockSignals(True)
        for item in self._items():
            wanted = str(item.data(0, _NAME)) in names
            item.setCheckState(0, Qt.CheckState.Checked if wanted else Qt.CheckState.Unchecked)
        self.tree.blockSignals(False)
        self._apply_choice()

    def _on_item(self, item: QTreeWidgetItem, column: int) -> None:
        if column == 0 and item.childCount() == 0:
            self._apply_choice()

    def _apply_choice(self) -> None:
        self.plots.choose(self.chosen)
        self._colour_tree()
        self._on_cursor(self.plots.cursor_s)

    def _colour_tree(self) -> None:
        """Each chosen signal's name has the colour of its line."""
        if self.run is None:
            return
        self.tree.blockSignals(True)
        chosen = self.chosen
        for item in self._items():
            name = str(item.data(0, _NAME))
            signal = self.run.signals[name]
            colour = QColor(self._colours.text)
            if name in chosen and signal.family == "motion":
                colour = QColor(self._colours.rotation if name == ROTATION else self._colours.velocity)
            elif name in chosen:
                family = [n for n in chosen if self.run.signals[n].family == signal.family]
                colour = shade(self._colours.family(signal.family), family.index(name), len(family))
            item.setForeground(0, QBrush(colour))
        self.tree.blockSignals(False)

    # -- moving ----------------------------------------------------------------------------------

    def show_whole(self) -> None:
        """Show the whole run."""
        if self.run is not None:
            self.plots.set_view(*self.run.span_s)

    def show_motion(self) -> None:
        """Show from a second before the release to a little after the last event of the motion."""
        run = self.run
        if run is None:
            return
        times = {event.kind: run.time_of(event.sample - run.first_sample) for event in run.events}
        if "released" not in times:
            self.show_whole()
            return
        end = times.get("at_rest", run.span_s[1])
        self.plots.set_view(max(run.span_s[0], times["released"] - 1.0), min(run.span_s[1], end + 0.5))

    def _step(self, direction: int) -> None:
        """Move the cursor by a two-hundredth of the view."""
        start, stop = self.plots.view_s
        if math.isfinite(self.plots.cursor_s):
            self.plots.set_cursor(self.plots.cursor_s + direction * (stop - start) / 200.0)

    def _zoom(self, factor: float) -> None:
        """Zoom about the cursor."""
        start, stop = self.plots.view_s
        centre = self.plots.cursor_s
        if not start <= centre <= stop:
            centre = (start + stop) / 2
        self.plots.set_view(centre - (centre - start) * factor, centre + (stop - centre) * factor)

    def _to_event(self, item: QListWidgetItem) -> None:
        time = float(item.data(_NAME))
        start, stop = self.plots.view_s
        if not start <= time <= stop:
            half = (stop - start) / 2
            self.plots.set_view(time - half, time + half)
        self.plots.set_cursor(time)

    def _on_cursor(self, time_s: float) -> None:
        run = self.run
        if run is None or not math.isfinite(time_s):
            return
        sample = run.first_sample + run.column_of(time_s)
        self._time.setText(f"Cursor {number(time_s, 4)} s · sample {sample}")
        self.tree.blockSignals(True)
        chosen = set(self.chosen)
        for item in self._items():
            name = str(item.data(0, _NAME))
            signal = run.signals[name]
            text = number(run.value_at(name, time_s), 3, signal.unit) if name in chosen else ""
            item.setText(1, text)
        self.tree.blockSignals(False)

    # -- export ----------------------------------------------------------------------------------

    def _choose_export(self, kind: str) -> None:
        if self.run is None:
            self.told.emit("info", "Open a run first.")
            return
        default = self.run.path.with_name(f"{self.run.path.stem}-view.{kind}")
        dialog = QFileDialog(self, f"Save {kind.upper()}", str(default.parent))
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.selectFile(default.name)
        dialog.setDefaultSuffix(kind)
        dialog.setModal(False)
        dialog.fileSelected.connect(lambda name: self.export(kind, Path(name)))
        dialog.show()

    def export(self, kind: str, path: Path) -> None:
        """Save the plots as picture (png, svg) or the visible samples (csv)."""
        if self.run is None:
            return
        try:
            # The dialog has asked whether to replace a file; a recording never is.
            require_replaceable(path, [self.run.path], overwrite=True)
            if kind == "csv":
                rows = self.run.write_csv(path, self.chosen, *self.plots.view_s)
                self.told.emit("info", f"{rows} rows of {len(self.chosen)} signals saved as {path.name}.")
                return
            with written_whole(path) as beside:
                if kind == "svg":
                    self._write_svg(beside)
                else:
                    exporter = pyqtgraph.exporters.ImageExporter(self.plots.scene())
                    exporter.parameters()["width"] = 2 * self.plots.width()
                    exporter.export(str(beside))
                if beside.stat().st_size == 0:
                    raise OSError("the file was not written")
        except (OSError, RunFileError) as error:
            self.told.emit("error", f"{path} could not be saved ({error}). Choose another folder.")
            return
        self.told.emit("info", f"The view was saved as {path.name}.")

    def _write_svg(self, path: Path) -> None:
        """Qt draws the scene itself: pyqtgraph's own exporter stumbles over curved paths."""
        scene = self.plots.scene()
        size = self.plots.size()
        generator = QSvgGenerator()
        generator.setFileName(str(path))
        generator.setSize(size)
        generator.setViewBox(QRect(QPoint(0, 0), size))
        generator.setTitle(self.run.path.name if self.run is not None else "")
        painter = QPainter(generator)
        try:
            painter.fillRect(QRect(QPoint(0, 0), size), QColor(self._colours.surface))
            scene.render(painter, QRectF(QRect(QPoint(0, 0), size)), QRectF(self.plots.viewRect()))
        finally:
            painter.end()

"""The first thing on screen when no rig was named: choose a rig file and a folder for the runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import (
    QFileDialog,
    QHBoxLayout,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from daq_app.acquisition.viewers.client import AcquisitionUnreachable
from daq_app.acquisition.viewers.launcher import AcquisitionDied
from daq_app.config import ConfigError, load_rig
from daq_app.config.shipped import shipped_configs
from daq_app.monitor.data.settings import WindowSettings
from daq_app.monitor.look.labels import PlainLabel, role_label, set_role
from daq_app.monitor.look.theme import font

_NO_RIGS = "No rig was opened here before, and this folder has no configs/*.toml: choose a rig file below."
Start = Callable[[Path, Path], None]


def known_rigs(settings: WindowSettings, folder: Path) -> list[Path]:
    """Rig files used before, those in ``configs`` of the working folder, those that come with the program.

    Only those that exist.
    """
    found = [*settings.recent_rigs, *sorted((folder / "configs").glob("*.toml"))]
    found += sorted(shipped_configs().glob("*.toml"))
    return list(dict.fromkeys(path.resolve() for path in found if path.is_file()))


class StartWindow(QWidget):
    """Calls `start(rig, runs folder)`; closes itself once that has worked."""

    def __init__(self, settings: WindowSettings, out: Path, start: Start) -> None:
        super().__init__()
        self.setWindowTitle("Rocking-test recorder")
        self.resize(820, 560)
        self._start = start
        title = PlainLabel("Which rig?")
        title.setFont(font(22, bold=True))
        self.rigs = QListWidget()
        self.rigs.setFont(font(12))
        self.rigs.setWordWrap(True)
        self.rigs.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        for path in known_rigs(settings, Path.cwd()):
            self._add(path)
        if self.rigs.count():
            self.rigs.setCurrentRow(0)
        self.out = QLineEdit(str(out))
        browse_rig = QPushButton("Another rig file …")
        browse_out = QPushButton("Choose …")
        self.go = QPushButton("Open  Enter")
        self.go.setProperty("role", "primary")
        self.go.setDefault(True)
        self.message = role_label("" if self.rigs.count() else _NO_RIGS, "muted")
        self.message.setWordWrap(True)
        self.message.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        folder_row = QHBoxLayout()
        folder_row.addWidget(role_label("Runs go into", "heading"))
        folder_row.addWidget(self.out, 1)
        folder_row.addWidget(browse_out)
        buttons = QHBoxLayout()
        buttons.addWidget(browse_rig)
        buttons.addStretch(1)
        buttons.addWidget(self.go)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(28, 24, 28, 24)
        layout.setSpacing(12)
        layout.addWidget(title)
        layout.addWidget(self.rigs, 1)
        layout.addLayout(folder_row)
        layout.addWidget(self.message)
        layout.addLayout(buttons)
        browse_rig.clicked.connect(self._browse_rig)
        browse_out.clicked.connect(self._browse_out)
        self.go.clicked.connect(self._open)
        self.rigs.itemActivated.connect(lambda _item: self._open())
        self.out.returnPressed.connect(self._open)

    def _add(self, path: Path) -> None:
        try:
            text = f"{load_rig(path).description or path.stem}\n{path}"
        except ConfigError as error:
            text = f"{path.stem}: {len(error.problems)} problem(s) in this file\n{path}"
        item = QListWidgetItem(text)
        item.setData(Qt.ItemDataRole.UserRole, str(path))
        self.rigs.addItem(item)

    def _browse_rig(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, "Rig file", str(Path.cwd()), "Rig files (*.toml)")
        if name:
            self._add(Path(name))
            self.rigs.setCurrentRow(self.rigs.count() - 1)

    def _browse_out(self) -> None:
        name = QFileDialog.getExistingDirectory(self, "Folder of the runs", self.out.text())
        if name:
            self.out.setText(name)

    def _open(self) -> None:
        item = self.rigs.currentItem()
        if item is None:
            self._say("Choose a rig file first.", "warning")
            return
        self.go.setEnabled(False)
        self._say("Starting the recorder …", "muted")
        # The sentence must be on screen before the start, which takes some seconds.
        QTimer.singleShot(50, lambda: self._try(Path(str(item.data(Qt.ItemDataRole.UserRole)))))

    def _try(self, rig: Path) -> None:
        try:
            self._start(rig, Path(self.out.text()).expanduser())
        except (ConfigError, AcquisitionDied, AcquisitionUnreachable, OSError) as error:
            self._say(str(error), "bad")
            self.go.setEnabled(True)
            return
        self.close()

    def _say(self, text: str, role: str) -> None:
        self.message.setText(text)
        set_role(self.message, role)

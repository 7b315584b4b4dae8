"""What the window remembers between two days: theme, type size, layout, folders."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import platformdirs
from PySide6.QtCore import QByteArray, QSettings
from PySide6.QtWidgets import QSplitter, QWidget

TYPE_SIZES: Final = (9.0, 10.0, 11.5, 13.0, 15.0)
_RECENT: Final = 8


def settings_file() -> Path:
    """Where the window's memory lies for this user."""
    return Path(platformdirs.user_config_dir("rocking-test-recorder", appauthor=False)) / "window.ini"


@dataclass(slots=True)
class WindowSettings:
    """Reads and writes one ini file; a file that cannot be written is no reason not to measure."""

    path: Path = field(default_factory=settings_file)
    _store: QSettings = field(init=False)

    def __post_init__(self) -> None:
        self._store = QSettings(str(self.path), QSettings.Format.IniFormat)

    def _text(self, key: str, default: str) -> str:
        return str(self._store.value(key, default))

    def _number(self, key: str, default: float) -> float:
        try:
            return float(self._text(key, str(default)))
        except ValueError:
            return default

    @property
    def theme(self) -> str:
        """``dark`` or ``light``."""
        return "light" if self._text("theme", "dark") == "light" else "dark"

    @theme.setter
    def theme(self, name: str) -> None:
        self._store.setValue("theme", name)

    @property
    def type_size(self) -> float:
        """Base type size in points, one of `TYPE_SIZES`."""
        wanted = self._number("type_size", 10.0)
        return min(TYPE_SIZES, key=lambda size: abs(size - wanted))

    @type_size.setter
    def type_size(self, points: float) -> None:
        self._store.setValue("type_size", points)

    @property
    def sounds(self) -> bool:
        """Whether sounds are to be heard."""
        return self._text("sounds", "on") == "on"

    @sounds.setter
    def sounds(self, on: bool) -> None:
        self._store.setValue("sounds", "on" if on else "off")

    @property
    def recent_rigs(self) -> list[Path]:
        """Rig files that were opened, the newest first."""
        return [Path(part) for part in self._text("recent_rigs", "").split("|") if part]

    def add_recent_rig(self, rig: Path) -> None:
        """Remember a rig file that was opened."""
        rigs = [rig.resolve(), *(old for old in self.recent_rigs if old != rig.resolve())]
        self._store.setValue("recent_rigs", "|".join(str(path) for path in rigs[:_RECENT]))

    @property
    def runs_folder(self) -> Path:
        """Folder of the runs that was used last."""
        text = self._text("runs_folder", "")
        return Path(text) if text else Path(platformdirs.user_documents_dir()) / "rocking-runs"

    @runs_folder.setter
    def runs_folder(self, folder: Path) -> None:
        self._store.setValue("runs_folder", str(folder.resolve()))

    def save_layout(self, window: QWidget, splitters: dict[str, QSplitter]) -> None:
        """Remember where the window and its dividers are."""
        self._store.setValue("layout/window", window.saveGeometry())
        for name, splitter in splitters.items():
            self._store.setValue(f"layout/{name}", splitter.saveState())
        self._store.sync()

    def restore_layout(self, window: QWidget, splitters: dict[str, QSplitter]) -> bool:
        """Put window and dividers where they were; False if nothing is remembered."""
        geometry = self._store.value("layout/window")
        if not isinstance(geometry, QByteArray) or not window.restoreGeometry(geometry):
            return False
        for name, splitter in splitters.items():
            state = self._store.value(f"layout/{name}")
            if isinstance(state, QByteArray):
                splitter.restoreState(state)
        return True

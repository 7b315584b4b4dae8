"""Saved pages and PDF files in the program that this computer has for them, or what to do without one."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Final, cast

from PySide6.QtCore import QTimer, QUrl
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QWidget

from daq_app.monitor.widgets.banner import TellingPage

_LOOK_MS: Final = 200
_FAILS_WITHIN_S: Final = 10.0
"""An opener that finds no program says so by then; one that ends later was a program that was closed."""
_KINDS: Final = {".pdf": ("PDF files", "a PDF viewer"), ".html": ("pages", "a browser")}


def open_outside(page: QWidget, path: Path) -> None:
    """Show a saved file in the program that this computer has for it.

    Where there is none, `page`, which is a `TellingPage` as well, says so.
    """
    # Where xdg-open is there Qt starts it and takes that for success; it is its exit code that tells.
    opener = shutil.which("xdg-open") if sys.platform.startswith("linux") else None
    if opener is not None:
        _watch(page, path, opener)
    elif not QDesktopServices.openUrl(QUrl.fromLocalFile(str(path))):
        _tell(page, path)


def _tell(page: QWidget, path: Path) -> None:
    cast("TellingPage", page).told.emit("warning", nothing_opens(path))


def nothing_opens(path: Path) -> str:
    """What is said where no program opens such a file, and what to do."""
    files, program = _KINDS.get(path.suffix, ("such files", "a program for them"))
    return f"No program on this computer opens {files}. Install {program}, or open elsewhere: {path}"


def _watch(page: QWidget, path: Path, opener: str) -> None:
    """Start `opener`; as long as it runs look whether it has failed."""
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(
        [opener, str(path)], stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True
    )
    until_s = time.monotonic() + _FAILS_WITHIN_S
    timer = QTimer(page)

    def look() -> None:
        if (code := process.poll()) is None:
            return
        timer.stop()
        timer.deleteLater()
        if code != 0 and time.monotonic() < until_s:
            _tell(page, path)

    timer.timeout.connect(look)
    timer.start(_LOOK_MS)

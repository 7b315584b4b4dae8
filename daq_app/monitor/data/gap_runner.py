"""Runs a diagnosis in a process of its own, off the window's thread, and can stop it at any time."""

from __future__ import annotations

import json
import subprocess
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Signal

from daq_app.gap.files import result_path
from daq_app.guarded import end_guarded, start_guarded
from daq_app.monitor.data.background import Background


class Stopped(Exception):
    """The diagnosis was stopped before its end."""


class GapRunner(QObject):
    """One diagnosis at a time. Emits `progress(done, total, text)`, `finished(path)` or `failed(why)`."""

    progress = Signal(int, int, str)
    finished = Signal(str)
    failed = Signal(str)

    def __init__(self, background: Background, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._background = background
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._stopped = False
        self.busy = False
        """From the start until `finished` or `failed` has been emitted."""

    def start(self, runs: Sequence[Path]) -> None:
        """Diagnose run files; does nothing while a diagnosis is under way."""
        if self.busy or not runs:
            return
        self.busy, self._stopped = True, False
        paths = list(runs)
        self._background.run(lambda: self._work(paths), self._on_done, self._on_trouble)

    def stop(self) -> None:
        """End the diagnosis that is under way; `failed` tells when it has ended."""
        with self._lock:
            self._stopped = True
            if self._process is not None:
                self._process.kill()

    def _work(self, runs: Sequence[Path]) -> str:
        with self._lock:
            if self._stopped:
                raise Stopped
            arguments = [str(result_path(runs)), *(str(run) for run in runs)]
            process = self._process = start_guarded("daq_app.gap.job", arguments)
        try:
            said = self._listen(process)
        finally:
            with self._lock:
                self._process = None
            end_guarded(process)
        if self._stopped:
            raise Stopped
        if "result" not in said:
            raise RuntimeError(str(said.get("refused") or "The diagnosis ended without a word."))
        return str(said["result"])

    def _listen(self, process: subprocess.Popen[str]) -> dict[str, Any]:
        """Pass progress on until the last word, which is returned."""
        assert process.stdout is not None
        said: dict[str, Any] = {}
        for line in process.stdout:
            try:
                said = json.loads(line)
            except ValueError:
                continue  # a library that prints
            if "total" in said:
                self.progress.emit(int(said["done"]), int(said["total"]), str(said["text"]))
        return said

    def _on_done(self, path: str) -> None:
        self.busy = False
        self.finished.emit(path)

    def _on_trouble(self, error: Exception) -> None:
        self.busy = False
        if isinstance(error, Stopped):
            self.failed.emit("The diagnosis was stopped.")
        elif isinstance(error, (RuntimeError, OSError)):
            self.failed.emit(str(error))
        else:
            raise error

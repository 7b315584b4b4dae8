"""Which tasks are open on a device server, on disk: so that the next start can clear what a crash left.

A local NI driver gives hardware back when its process dies; a device server does not. The names are
unique, so only tasks of our own are ever cleared; the folder is ours alone (its lock is held).
"""

from __future__ import annotations

import contextlib
import json
from pathlib import Path


class TaskLedger:
    """Names of open tasks for one device server; a missing or unreadable file is an empty ledger."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def left_behind(self, target: str) -> list[str]:
        """Names that an earlier session opened on `target` and never closed."""
        try:
            content = json.loads(self._path.read_text(encoding="utf-8"))
            if content["target"] != target:
                return []
            return [name for name in content["tasks"] if isinstance(name, str)]
        except (OSError, ValueError, KeyError, TypeError):
            return []

    def opening(self, target: str, names: list[str]) -> None:
        """Call before the tasks are created. A folder that cannot be written to is no reason to fail."""
        with contextlib.suppress(OSError):
            self._path.unlink(missing_ok=True)  # it may be a link to another file
            self._path.write_text(json.dumps({"target": target, "tasks": names}), encoding="utf-8")

    def closed(self) -> None:
        """All tasks have been given back."""
        with contextlib.suppress(OSError):
            self._path.unlink(missing_ok=True)

"""A link without an acquisition: the whole window with its live pages, fed by hand."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from PySide6.QtCore import QObject, Signal

from daq_app.monitor.data.session import Published


class QuietLink(QObject):
    """Says what rig there is, keeps what was ordered, and hands out what a test puts in."""

    replied = Signal(str, object)
    urgent = Signal()
    address = "tcp://nowhere"

    def __init__(self, rig_file: Path, *, may_command: bool = True) -> None:
        super().__init__()
        self.may_command = may_command
        self.about = {"rig_text": rig_file.read_text(encoding="utf-8"), "rig_name": "fr1", "rate_hz": 4000.0}
        self.orders: list[tuple[str, dict[str, float | str]]] = []
        self.inbox: list[Published] = []

    def take(self) -> list[Published]:
        taken, self.inbox = self.inbox, []
        return taken

    def request(self, name: str, arguments: Mapping[str, float | str] | None = None) -> None:
        self.orders.append((name, dict(arguments or {})))

    def close(self) -> None:
        pass

"""The simulated wall's winch and hook, for practice: shown only where the rig file says ``simulated``."""

from __future__ import annotations

import math
from typing import Any

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPushButton, QWidget

from daq_app.monitor.data.background import Background
from daq_app.monitor.look.labels import role_label


class WallCard(QFrame):
    """Pulls and releases the simulated wall. Emits `told(severity, text)`."""

    told = Signal(str, str)

    def __init__(self, background: Background, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("card")
        self._background = background
        self._address = ""
        self.target_ratio = math.nan
        self.buttons = {
            "pull": QPushButton("Pull"),
            "release": QPushButton("Release"),
            "upright": QPushButton("Let down"),
        }
        layout = QHBoxLayout(self)
        layout.setContentsMargins(12, 6, 12, 6)
        layout.addWidget(role_label("Simulated wall", "heading"), 1)
        for name, button in self.buttons.items():
            button.clicked.connect(lambda _checked=False, n=name: self.order(n))
            layout.addWidget(button)
        self.hide()

    def set_address(self, connection: str) -> None:
        """Where the simulator listens (``grpc://HOST:PORT``); anything else hides the card."""
        self._address = connection if connection.startswith("grpc://") else ""
        self.setVisible(bool(self._address))

    def order(self, name: str) -> None:
        """Pull to the chosen level, release, or let the wall down."""
        arguments: dict[str, float] = {}
        if name == "pull" and math.isfinite(self.target_ratio):
            arguments["theta0_over_alpha"] = self.target_ratio
        address = self._address
        if not address:
            return
        self._background.run(
            lambda: _command(address, name, arguments),
            lambda _state: None,
            lambda error: self.told.emit("warning", f"Simulated wall: {error}"),
        )


def _command(address: str, name: str, arguments: dict[str, float]) -> Any:
    # Imported here: a window on a real rig never loads the simulation.
    from sim_hardware.control import SimControl

    with SimControl(address) as control:
        return control.command(name, **arguments)

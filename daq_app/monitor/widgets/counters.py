"""The row of large figures above the plots."""

from __future__ import annotations

import math
from dataclasses import dataclass

from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QWidget

from daq_app.acquisition.messages.published import RECORDING, MotionMessage, State
from daq_app.config.wording import plus_minus
from daq_app.monitor.data.session import Session
from daq_app.monitor.look.labels import DASH, Tile, number, restitution_text


@dataclass(frozen=True, slots=True)
class TileText:
    """What a tile shows."""

    value: str
    detail: str = ""
    role: str = ""


CAPTIONS = {
    "rotation": "Rotation θ",
    "margin": "To overturning",
    "peak": "Peak θ/α",
    "elapsed": "Since release",
    "impacts": "Impacts",
    "eav": "r by EAV",
    "crt": "r by CRT",
}


def tile_texts(session: Session) -> dict[str, TileText]:
    """The figures by tile; a measured value that is not live is a dash."""
    alpha = session.alpha_rad
    live = session.fresh(MotionMessage)
    texts: dict[str, TileText] = {}
    rotation = session.judged_rad if live else math.nan
    ratio = rotation / alpha
    unknown = "not known" if live else "not live"
    texts["rotation"] = TileText(
        number(rotation * 1e3, 1, "mrad"), f"θ/α = {number(ratio, 3)}" if math.isfinite(ratio) else unknown
    )
    margin = session.overturning_margin
    if session.rig is None or not math.isfinite(margin):
        texts["margin"] = TileText(DASH, unknown)
    else:
        used, limits = 1.0 - margin, session.rig.acquisition
        role = "bad" if used >= limits.alarm_ratio else "warning" if used >= limits.warning_ratio else "good"
        words = {
            "bad": "⚠ ALARM: keep clear",
            "warning": "⚠ high rotation",
            "good": f"alarm at θ/α {limits.alarm_ratio:g}",
        }
        texts["margin"] = TileText(f"{100 * margin:.0f} %", words[role], role)
    estimate = session.estimate
    peak = session.peak_rotation_rad
    since = "since arming" if session.saw_arming else "since this window opened"
    texts["peak"] = TileText(number(peak / alpha, 3) if peak > 0 else DASH, since if peak > 0 else "")
    running = session.current_state in RECORDING
    which = "this test" if running else "last test"
    if estimate is None:
        state = session.current_state
        held = state in (State.ARMED, State.HOLDING)
        waiting = "waiting for the release" if held else "no impact heard yet" if running else ""
        texts["elapsed"] = TileText(DASH, waiting)
        texts["impacts"] = TileText(DASH)
        texts["eav"] = texts["crt"] = TileText(DASH)
        return texts
    texts["elapsed"] = TileText(number(session.since_release_s, 1, "s"), which)
    texts["impacts"] = TileText(str(len(estimate.impact_samples)), which)
    for name, mean, error, points in (
        ("eav", estimate.eav_mean, estimate.eav_standard_error, estimate.eav),
        ("crt", estimate.crt_mean, estimate.crt_standard_error, estimate.crt),
    ):
        of_bound = f"{mean / estimate.r_max:.2f} r_max" if mean is not None else ""
        detail = " · ".join(part for part in (plus_minus(error), of_bound) if part)
        if session.run_zeroed is False and points:
            texts[name] = TileText(restitution_text(mean), "⚠ no zero: ~3 % off", "warning")
        else:
            texts[name] = TileText(restitution_text(mean), detail if points else "needs three impacts")
    return texts


class Counters(QWidget):
    """The tiles."""

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(6)
        self.tiles: dict[str, Tile] = {}
        wide = {"rotation": 12, "margin": 11, "eav": 11, "crt": 11}
        for name, caption in CAPTIONS.items():
            self.tiles[name] = Tile(caption)
            layout.addWidget(self.tiles[name], wide.get(name, 8))

    def resizeEvent(self, event: QResizeEvent) -> None:
        """The figures grow with the window, to be read from afar."""
        super().resizeEvent(event)
        points = max(15.0, min(40.0, self.width() / 60.0))
        for tile in self.tiles.values():
            tile.set_points(points)

    def refresh(self) -> None:
        """Bring the tiles up to date."""
        for name, text in tile_texts(self._session).items():
            self.tiles[name].show_value(text.value, text.detail, text.role)

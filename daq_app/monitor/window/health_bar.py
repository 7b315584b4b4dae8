"""The figures that tell whether the record is whole: buffer, gaps, overloads, file, disk."""

from __future__ import annotations

from dataclasses import dataclass

from PySide6.QtWidgets import QHBoxLayout, QLabel, QWidget

from daq_app.acquisition.messages.published import HealthMessage
from daq_app.monitor.data.session import Session
from daq_app.monitor.look.labels import DASH, PlainLabel, role_label, set_role, size_text

BUFFER_WARNING = 0.25
BUFFER_BAD = 0.7
FREE_WARNING_BYTES = 5e9
FREE_BAD_BYTES = 1e9
_USUAL = ("00 %", "0", "none", "00.0 MB", "00.0 GB", "00 ms")


@dataclass(frozen=True, slots=True)
class HealthText:
    """One figure: its caption, its value and the role of its colour."""

    caption: str
    value: str
    role: str = ""


def health_texts(health: HealthMessage | None, fresh: bool) -> list[HealthText]:
    """The figures of a health message; dashes when it is missing or old."""
    captions = ("Buffer", "Gaps", "Overload", "File", "Free", "To disk")
    if health is None or not fresh:
        return [HealthText(caption, DASH) for caption in captions]
    fill = health.backlog_samples / health.buffer_samples if health.buffer_samples else 0.0
    fill_role = "bad" if fill > BUFFER_BAD else "warning" if fill > BUFFER_WARNING else ""
    free_role = (
        "bad"
        if health.free_bytes < FREE_BAD_BYTES
        else "warning"
        if health.free_bytes < FREE_WARNING_BYTES
        else ""
    )
    gaps = f"{health.gaps} ({health.lost_samples} samples)" if health.gaps else "0"
    shown = health.overloaded[:2]
    more = f" +{len(health.overloaded) - 2}" if len(health.overloaded) > 2 else ""
    return [
        HealthText("Buffer", f"{100 * fill:.0f} %", fill_role),
        HealthText("Gaps", gaps, "bad" if health.gaps else ""),
        HealthText(
            "Overload", ", ".join(shown) + more if shown else "none", "warning" if health.overloaded else ""
        ),
        HealthText("File", size_text(health.file_bytes) if health.recording else DASH),
        HealthText("Free", size_text(health.free_bytes), free_role),
        HealthText("To disk", f"{health.block_to_disk_ms_p99:.0f} ms" if health.recording else DASH),
    ]


class HealthBar(QWidget):
    """The figures in a row."""

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._values: list[QLabel] = []
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(5)
        for figure in health_texts(None, fresh=False):
            value = PlainLabel(figure.value)
            layout.addWidget(role_label(figure.caption, "muted"))
            layout.addWidget(value)
            layout.addSpacing(9)
            self._values.append(value)

    def refresh(self) -> None:
        """Bring the figures up to date."""
        figures = health_texts(self._session.health, self._session.fresh(HealthMessage))
        for label, figure, usual in zip(self._values, figures, _USUAL, strict=True):
            # Room for the usual value: figures that come and go must not push each other about.
            label.setMinimumWidth(label.fontMetrics().horizontalAdvance(usual))
            text = f"⚠ {figure.value}" if figure.role else figure.value
            if label.text() != text:
                label.setText(text)
            set_role(label, figure.role)

    @property
    def texts(self) -> list[str]:
        """The values as shown, in the order buffer, gaps, overload, file, free, to disk."""
        return [label.text() for label in self._values]

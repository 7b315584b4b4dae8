"""Which texts of a window are cut off: by geometry, on every visible widget."""

from __future__ import annotations

from PySide6.QtWidgets import (
    QAbstractButton,
    QComboBox,
    QLabel,
    QLineEdit,
    QStyle,
    QStyleOptionComboBox,
    QWidget,
)

_FIELD_PX = 12
"""Frame and padding of a field."""


def clipped_texts(root: QWidget) -> list[str]:
    """One line for each visible text that needs more room than it has."""
    return [line for widget in root.findChildren(QWidget) if widget.isVisible() for line in _of(widget)]


def _of(widget: QWidget) -> list[str]:
    match widget:
        case QLabel() if widget.text() and "<" not in widget.text():
            return _of_label(widget)
        case QAbstractButton() if widget.text():
            hint = widget.sizeHint()
            fits = hint.width() <= widget.width() + 1 and hint.height() <= widget.height() + 1
            return [] if fits else [f"button {widget.text()!r}: {widget.size()} for {hint}"]
        case QLineEdit():
            return _of_field(widget, widget.text() or widget.placeholderText(), widget.width() - _FIELD_PX)
        case QComboBox():
            return _of_field(widget, widget.currentText(), _room_of(widget))
    return []


def _of_label(label: QLabel) -> list[str]:
    if label.wordWrap():
        needs = label.heightForWidth(label.width())
        return (
            [] if needs <= label.height() + 1 else [f"lines of {label.text()!r}: {label.height()} < {needs}"]
        )
    metrics = label.fontMetrics()
    wide = max(metrics.horizontalAdvance(line) for line in label.text().split("\n"))
    room = label.contentsRect().width() + 1
    told = [] if wide <= room else [f"label {label.text()!r}: {room} < {wide}"]
    return told + ([] if metrics.height() <= label.height() + 2 else [f"height of {label.text()!r}"])


def _room_of(choice: QComboBox) -> int:
    """Width between the frame and the arrow, as the style draws them."""
    option = QStyleOptionComboBox()
    choice.initStyleOption(option)
    field = QStyle.SubControl.SC_ComboBoxEditField
    return choice.style().subControlRect(QStyle.ComplexControl.CC_ComboBox, option, field, choice).width()


def _of_field(field: QWidget, text: str, room: int) -> list[str]:
    wide = field.fontMetrics().horizontalAdvance(text)
    return [] if wide <= room else [f"field {text!r}: {room} < {wide}"]

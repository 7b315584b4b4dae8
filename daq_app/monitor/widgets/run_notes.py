"""Operator and notes of a run, on every page that shows one."""

from __future__ import annotations

from typing import Final

from PySide6.QtWidgets import QLabel

from daq_app.campaign.status import TestFacts
from daq_app.config.shown_text import shortened
from daq_app.monitor.look.labels import tip_text

_SHOWN: Final = 240
"""Characters on the page; the rest is in the tool tip."""


def show_notes(label: QLabel, facts: TestFacts) -> None:
    """In short on the page, whole when pointed at; hidden where there is nothing to say."""
    said = [facts.operator, *facts.notes]
    label.setText(shortened(" · ".join(filter(None, said)), _SHOWN))
    label.setToolTip(tip_text("\n".join(said)))
    label.setVisible(bool(label.text()))

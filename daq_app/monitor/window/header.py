"""The strip at the top: the state in words, shape and colour, and the recording light."""

from __future__ import annotations

from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QVBoxLayout, QWidget

from daq_app.monitor.course.recording_light import recording_light
from daq_app.monitor.data.session import Session
from daq_app.monitor.look.labels import FittedLabel, PlainLabel, role_label, set_role, tip_text
from daq_app.monitor.look.shapes import Sign
from daq_app.monitor.look.state_look import look_of, name_of_test
from daq_app.monitor.look.theme import Colours


class Header(QFrame):
    """Shows a session's state; `refresh` is called several times a second."""

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("bar")
        self._session = session
        self._sign = Sign(34)
        self._word = PlainLabel()
        self._word.setProperty("scale", "state")
        self._test = PlainLabel()
        self._test.setProperty("scale", "name")
        self._sentence = FittedLabel("muted")
        self._light = Sign(22)
        self._light_word = PlainLabel()
        self._light_word.setProperty("scale", "name")
        self._light_detail = role_label("", "muted")
        self._light_detail.setMinimumWidth(170)

        middle = QVBoxLayout()
        middle.setSpacing(0)
        middle.addWidget(self._test)
        middle.addWidget(self._sentence)
        right = QVBoxLayout()
        right.setSpacing(0)
        right.addWidget(self._light_word)
        right.addWidget(self._light_detail)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(16, 8, 16, 8)
        layout.setSpacing(12)
        layout.addWidget(self._sign)
        layout.addWidget(self._word)
        layout.addSpacing(16)
        layout.addLayout(middle, 1)
        layout.addSpacing(16)
        layout.addWidget(self._light)
        layout.addLayout(right)

    def refresh(self, colours: Colours) -> None:
        """Bring the strip up to date."""
        session = self._session
        state = session.current_state
        judgement = session.judgement
        look = look_of(state, judgement)
        colour = str(getattr(colours, look.tone))
        self._sign.show_shape(look.shape, colour)
        self._word.setText(look.word)
        _colour(self._word, colour)
        message = session.state
        self._test.setText(name_of_test(message))
        sentence = look.sentence
        if session.data_missing:
            sentence = "No data for more than half a second: what is shown is not live."
        self._sentence.setText(sentence)
        self._sentence.setToolTip(tip_text(sentence))
        wrong = session.data_missing or state is None or bool(judgement.alarm)
        set_role(self._sentence, "bad" if wrong else "muted")
        light = recording_light(session)
        self._show_light(light.shape, str(getattr(colours, light.tone)), light.word, light.detail)

    def _show_light(self, shape: str, colour: str, word: str, detail: str) -> None:
        self._light.show_shape(shape, colour)
        self._light_word.setText(word)
        _colour(self._light_word, colour)
        self._light_detail.setText(detail)
        self._light_detail.setVisible(bool(detail))

    @property
    def words(self) -> dict[str, str]:
        """What is written: keys state, test, sentence, recording, recording_detail."""
        return {
            "state": self._word.text(),
            "test": self._test.text(),
            "sentence": self._sentence.text(),
            "recording": self._light_word.text(),
            "recording_detail": self._light_detail.text(),
        }


def _colour(label: QLabel, colour: str) -> None:
    """Colour a label's text; a style sheet that is set anew is worked out anew, so only on a change."""
    sheet = f"color: {colour};"
    if label.styleSheet() != sheet:
        label.setStyleSheet(sheet)

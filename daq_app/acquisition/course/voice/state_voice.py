"""What viewers hear of the state: one message with the recorder's judgement, when a word of it changes."""

from __future__ import annotations

import time
from typing import Final

from daq_app.acquisition.course.voice.judgement import Situation, judge
from daq_app.acquisition.messages.published import Judgement, State, StateMessage
from daq_app.acquisition.messages.publisher import Publisher
from daq_app.config.rig import Acquisition
from daq_app.runfile import TestPlan

REPEAT_S: Final = 1.0
"""The state is repeated so often: a viewer that has just come knows at once."""
_FIGURES: Final = {"ratio": None, "held_s": 0.0}
"""Parts of a judgement that change all the time without a word."""


class StateVoice:
    """Holds the state, makes the judgement, and publishes both."""

    def __init__(self, publisher: Publisher, settings: Acquisition) -> None:
        self.state = State.IDLE
        self.text = ""
        self.test = ""
        self.run_path = ""
        self.plan = TestPlan()
        """The test that is armed, or would be armed now."""
        self.sample = 0
        """Samples that have been looked at."""
        self.armed = self.locked = False
        self.judgement = Judgement()
        self._publisher = publisher
        self._settings = settings
        self._since = 0
        self._last_s = 0.0

    @property
    def since(self) -> int:
        """Sample at which the state began."""
        return self._since

    def enter(self, state: State, text: str, since: int | None = None) -> None:
        """Another state; `judge` has to follow."""
        self.state, self.text = state, text
        self._since = self.sample if since is None else since

    def judge(self, situation: Situation, *, locked: bool, force: bool = False) -> None:
        """Judge the situation; published where a word has changed, or with `force`."""
        before, self.judgement = self.judgement, judge(situation, self._settings)
        self.armed, self.locked = situation.armed, locked
        if force or self.judgement.model_copy(update=_FIGURES) != before.model_copy(update=_FIGURES):
            self._last_s = 0.0
            self.repeat()

    def repeat(self) -> None:
        """Publish what holds, unless that was done within the last second."""
        now = time.monotonic()
        if now - self._last_s >= REPEAT_S:
            self._last_s = now
            self._publisher.send("state", self.message())

    def message(self) -> StateMessage:
        """The state as viewers see it."""
        return StateMessage(
            state=self.state,
            test=self.test,
            run_path=self.run_path,
            text=self.text,
            since_sample=self._since,
            sample=self.sample,
            armed=self.armed,
            plan=self.plan,
            locked=self.locked,
            judgement=self.judgement,
        )

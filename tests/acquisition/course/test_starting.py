"""What a viewer hears while the device is being opened, which a slow one takes its time for."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

from daq_app.acquisition.closing.finaliser import Finaliser
from daq_app.acquisition.messages.published import StateMessage
from daq_app.acquisition.session.session import Session, SessionSettings
from daq_app.config import Rig, TaskPlan
from drivers import Driver, DriverError, Opened


class Listener:
    """A publisher that remembers the words of the state."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._words: list[str] = []

    def send(self, topic: str, message: Any, readings: bytes | None = None) -> None:
        if isinstance(message, StateMessage):
            with self._changed:
                self._words.append(message.judgement.word)
                self._changed.notify_all()

    def send_frames(self, frames: list[bytes], readings: bytes | None = None) -> None:
        pass

    def until(self, word: str) -> bool:
        with self._changed:
            return self._changed.wait_for(lambda: word in self._words, 60.0)


def test_the_state_says_that_the_sensors_are_being_started(
    rig: Rig, rig_text: str, plan: TaskPlan, tmp_path: Path, finaliser: Finaliser
) -> None:
    listener: Any = Listener()
    told = threading.Event()

    class SlowDevice:
        def open(self, plan: TaskPlan) -> Opened:
            told.wait(60.0)
            raise DriverError("The chassis does not answer", advice="Look at its cable")

        def stop(self) -> None:
            pass

        def close(self) -> None:
            pass

    device: Driver = SlowDevice()  # type: ignore[assignment]
    session = Session(SessionSettings(rig, rig_text, plan, tmp_path, lambda: device), listener, finaliser)
    session.start()
    try:
        assert listener.until("Starting")
        told.set()
        assert listener.until("Failed")
    finally:
        told.set()
        session.close()

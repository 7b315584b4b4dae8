"""Takes one test without an operator: zero, arm, wait for the run to be saved, end.

Used by `daq-app run`: the process needs nobody, so that nothing that happens to the terminal costs a sample.
"""

from __future__ import annotations

import time
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, Final

from daq_app.acquisition.messages.items import RequestRefused
from daq_app.acquisition.messages.published import State
from daq_app.acquisition.session.session import Session
from daq_app.runfile import TestPlan

_ZERO_LIMIT_S: Final = 60.0


@dataclass
class Unattended:
    """Call `advance` now and then from the main thread; `finished` says when it is over, and how."""

    session: Session
    test: str
    notes: str = ""
    exit_code: int | None = None
    text: str = ""
    """Why it could not be done; for the operator."""
    _tare: Future[tuple[str, dict[str, Any]]] | None = None
    _arm: Future[Any] | None = None
    _armed: bool = False
    _since_s: float = field(default_factory=time.monotonic)

    def advance(self) -> None:
        """Take the next step, if it is due."""
        if self.exit_code is not None:
            return
        state = self.session.state
        if self._armed:
            if state is State.SAVED:
                self.exit_code = 0
            elif state is State.FAILED:
                self._fail(self.session.analyst.voice.text)
        elif state is State.FAILED:
            self._fail(self.session.analyst.voice.text)
        elif state is State.PREVIEWING and self._arm is None:
            self._zero()
        elif self._arm is not None and self._arm.done():
            error = self._arm.exception()
            if error is not None:
                self._fail(str(error), code=2)
            elif state is not State.PREVIEWING:
                self._armed = True

    def _zero(self) -> None:
        if self._tare is None:
            self._tare = self.session.ask("tare", {})
            return
        if not self._tare.done():
            return
        error = self._tare.exception()
        if error is None:
            try:
                self._arm = self.session.arm(TestPlan(test=self.test, notes=self.notes))
            except RequestRefused as refused:
                self._fail(str(refused), code=2)
        elif time.monotonic() - self._since_s > _ZERO_LIMIT_S:
            self._fail(str(error))
        else:
            self._tare = None  # not steady yet: try again with the next second

    def _fail(self, text: str, code: int = 3) -> None:
        self.exit_code = code
        self.text = text

"""The people of a test day at a simulated wall: zero, arm, pull, hold, release, test after test."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daq_app.acquisition.messages.published import EventMessage, State, StateMessage
from daq_app.acquisition.viewers.client import AcquisitionClient
from daq_app.campaign.plan import PlannedTest
from daq_app.cli.record.simulated_hand import SimulatedHand
from daq_app.config.rig import Rig

_QUIET_S: Final = 0.25
_ANSWER_S: Final = 60.0
"""Longest wait for an answer to an order, on a machine that is busy."""
_ZERO_ATTEMPTS: Final = 20
"""Attempts at a zero before the day is given up; between them a wall that sways comes to rest."""


class DayEnded(Exception):
    """The day cannot go on; why, for the operator."""


@dataclass(frozen=True, slots=True)
class DayTest:
    """A test of the day as it ended."""

    test: str
    outcome: str
    run: Path | None


class TestDay:
    """Takes tests through an acquisition of the simulated wall, as an operator and two helpers would."""

    __test__ = False  # no test of pytest's

    def __init__(self, client: AcquisitionClient, rig: Rig, say: Callable[[str], None]) -> None:
        """`client` may command; `say` gets each step in words."""
        self._client = client
        self._rig = rig
        self._say = say
        self._state = State.IDLE

    def take(self, tests: Sequence[PlannedTest]) -> list[DayTest]:
        """Take the tests in their order. Raises `DayEnded` and `AcquisitionUnreachable`."""
        self._wait_until_sampling()
        return [self._take_one(test) for test in tests]

    def _wait_until_sampling(self) -> None:
        while self._state not in (State.PREVIEWING, State.SAVED):
            received = self._client.receive(_QUIET_S)
            if received is not None and isinstance(received.message, StateMessage):
                self._state = received.message.state
                if self._state is State.FAILED:
                    raise DayEnded(received.message.text)

    def _take_one(self, planned: PlannedTest) -> DayTest:
        test = str(planned.name)
        self._zero()
        armed = self._client.request("arm", _ANSWER_S, test=test)
        if not armed.ok:
            raise DayEnded(armed.text)
        self._say(f"{test}: armed; the wall is pulled to {planned.theta0_over_alpha:.0%} of α and let go")
        connection = str(self._client.request("hello", _ANSWER_S).data["connection"])
        hand = SimulatedHand(connection, self._rig, planned.theta0_over_alpha)
        try:
            return self._follow(test, hand)
        finally:
            hand.close()

    def _zero(self) -> None:
        for _ in range(_ZERO_ATTEMPTS):
            zeroed = self._client.request("tare", _ANSWER_S)
            if zeroed.ok:
                return
            for _ in self._client.messages(_QUIET_S):
                break
        raise DayEnded(f"The sensors cannot be zeroed: {zeroed.text}")

    def _follow(self, test: str, hand: SimulatedHand) -> DayTest:
        while True:
            received = self._client.receive(_QUIET_S)
            if received is None:
                continue
            hand.take(received.message)
            if hand.trouble:
                raise DayEnded(hand.trouble)
            match received.message:
                case StateMessage(state=State.FAILED, text=text):
                    raise DayEnded(text)
                case EventMessage(kind="saved", data=data):
                    run = str(data.get("run", ""))
                    outcome = str(data.get("outcome", ""))
                    self._say(f"{test}: {outcome}, {Path(run).name}")
                    return DayTest(test, outcome, Path(run) if run else None)

"""Orders before the release, one after the other: zero, check, pull test, arm. Each waits for the last.

Two orders that follow each other within a second must not see half of each other: the check sees the zero
that was asked for before it, the arming takes both with it.
"""

from __future__ import annotations

import datetime as dt
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from daq_app.acquisition.checks.check_model import SensorCheck, Verdict
from daq_app.acquisition.checks.pull_check import PullTooSmall, check_pull
from daq_app.acquisition.checks.sensor_check import Conditions, check_at_rest
from daq_app.acquisition.course.tare import NotSteady, Tare, take_tare
from daq_app.acquisition.messages.items import Ask, RequestRefused
from daq_app.config.rig import Rig
from daq_app.config.scaling import Scaling
from daq_app.runfile import CheckFinding, CheckRecord, TestPlan
from drivers import Block, Opened

Floats = NDArray[np.float64]

_TARE_S: Final = 1.0
_CHECK_S: Final = 3.0
_PULL_S: Final = 0.5
_NAMES: Final = {"tare": "zero", "check": "sensor check", "pull": "pull test", "arm": "arming"}

Answer = tuple[str, dict[str, Any]]


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What the orders need to know beside the samples, asked when it is needed."""

    free_bytes: Callable[[], int]
    arm: Callable[[TestPlan], Future[Path]]
    """Begin to record; the future gives the journal's path."""
    say: Callable[[str, str, str], None]
    """Tell (kind, text, severity)."""


@dataclass(slots=True)
class _Running:
    """The order whose samples are being collected."""

    ask: Ask
    wanted: int
    blocks: list[Block]
    have: int = 0


class Preparation:
    """Zero and check in force, and the orders that change them. Void with each new start of the source."""

    def __init__(self, rig: Rig, opened: Opened, planned_rate_hz: float, around: Surroundings) -> None:
        self.tare = Tare()
        self.check: SensorCheck | None = None
        self._rest_readings: Floats | None = None
        """(n_channels, 1) mean readings of the last check at rest: the pull test compares with them."""
        self._rig = rig
        self._opened = opened
        self._planned_rate_hz = planned_rate_hz or opened.rate_hz
        self._around = around
        self._queue: deque[Ask] = deque()
        self._running: _Running | None = None
        self._zero_failed = ""
        """Why the zero that was asked for last could not be taken."""

    @property
    def busy(self) -> bool:
        """Whether an order is under way."""
        return self._running is not None or bool(self._queue)

    def order(self, ask: Ask, *, recording: bool) -> None:
        """Take an order in; it is answered when it has been carried out. Raises `RequestRefused`."""
        if recording and ask.name == "arm":
            raise RequestRefused("A run is being recorded already. Stop or abort it before the next one")
        if recording and ask.name != "pull":
            raise RequestRefused(f"A test is being recorded: the {_NAMES[ask.name]} cannot change now")
        if ask.name == "tare" and any(a.name == "tare" for a in self._asked()):
            raise RequestRefused("The zero is being taken already")
        ahead = [_NAMES[a.name] for a in self._asked()]
        if ahead:
            self._around.say("waiting", f"The {_NAMES[ask.name]} waits for the {ahead[-1]}", "info")
        self._queue.append(ask)
        self._start_next()

    def take(self, block: Block) -> None:
        """Continue with a block."""
        running = self._running
        if running is None:
            return
        running.blocks.append(block)
        running.have += block.n_samples
        if running.have >= running.wanted:
            self._running = None
            self._carry_out(running)
            self._start_next()

    def refuse_all(self, why: str) -> None:
        """Samples are missing, or none will come: what was being collected cannot be finished."""
        if self._running is not None:
            self._refuse(self._running.ask, f"The {_NAMES[self._running.ask.name]} could not be done: {why}")
            self._running = None
        self._start_next()

    def record_of_check(self, *, overruled: bool) -> CheckRecord | None:
        """The check in force, as a plan keeps it."""
        if self.check is None:
            return None
        return CheckRecord(
            verdict=self.check.verdict.value,
            summary=self.check.summary,
            taken_utc=self.check.taken_utc,
            overruled=overruled,
            findings=tuple(_findings(self.check)),
        )

    def _asked(self) -> list[Ask]:
        return ([self._running.ask] if self._running else []) + list(self._queue)

    def _start_next(self) -> None:
        while self._running is None and self._queue:
            ask = self._queue.popleft()
            if ask.name == "arm":
                self._arm(ask)
                continue
            try:
                seconds = self._seconds(ask)
            except RequestRefused as error:
                ask.done.set_exception(error)
                continue
            self._running = _Running(ask, round(seconds * self._opened.rate_hz), [])

    def _seconds(self, ask: Ask) -> float:
        default = {"tare": _TARE_S, "check": _CHECK_S, "pull": _PULL_S}[ask.name]
        seconds = float(ask.arguments.get("seconds", default))
        if ask.name == "tare" and not 0.2 <= seconds <= 60.0:
            raise RequestRefused(f"The zero is taken over 0.2 to 60 s, not {seconds:g} s")
        if ask.name == "check" and not 1.0 <= seconds <= 60.0:
            raise RequestRefused(f"The sensors are checked over 1 to 60 s, not {seconds:g} s")
        if ask.name == "pull" and self._rest_readings is None:
            raise RequestRefused("Check the sensors at rest first (F2): the pull test compares with it")
        return seconds

    def _carry_out(self, running: _Running) -> None:
        readings = np.concatenate([block.readings for block in running.blocks], axis=1)[:, : running.wanted]
        overloaded = frozenset(name for block in running.blocks for name in block.overloaded)
        try:
            match running.ask.name:
                case "tare":
                    answer = self._zero(readings, running.blocks[0].first_sample)
                case "check":
                    answer = self._check(readings, overloaded)
                case _:
                    answer = self._pull(readings)
        except (NotSteady, PullTooSmall, ValueError) as error:
            self._refuse(running.ask, str(error))
            return
        running.ask.done.set_result(answer)

    def _refuse(self, ask: Ask, text: str) -> None:
        if ask.name == "tare":
            self._zero_failed = text
        ask.done.set_exception(RequestRefused(text))

    def _zero(self, readings: Floats, first_sample: int) -> Answer:
        ranges = [self._opened.ranges[name] for name in self._rig.channel_ids]
        resolution = np.array([(high - low) / 2**16 for low, high in ranges])
        self.tare = take_tare(self._rig, readings, first_sample, resolution)
        self._zero_failed = ""
        self._around.say("tare", f"Zero taken over {readings.shape[1]} samples", "info")
        return "The zero has been taken", {"tare": self.tare.readings}

    def _check(self, readings: Floats, overloaded: frozenset[str]) -> Answer:
        conditions = Conditions(
            rate_hz=self._opened.rate_hz,
            planned_rate_hz=self._planned_rate_hz,
            free_bytes=self._around.free_bytes(),
            today=dt.date.today(),
            tare=dict(self.tare.readings),
            overloaded=overloaded,
        )
        si = Scaling.of(self._rig.channels, self.tare.readings).to_si(readings)
        self.check = check_at_rest(self._rig, si, conditions)
        self._rest_readings = readings.mean(axis=1, keepdims=True)
        self._tell_check()
        return self.check.summary, {"verdict": self.check.verdict.value}

    def _pull(self, readings: Floats) -> Answer:
        assert self.check is not None and self._rest_readings is not None
        scaling = Scaling.of(self._rig.channels)
        now = readings.mean(axis=1, keepdims=True)
        change = (scaling.to_si(now) - scaling.to_si(self._rest_readings))[:, 0]
        self.check = check_pull(self._rig, self.check, change)
        self._tell_check()
        return self.check.summary, {"verdict": self.check.verdict.value}

    def _tell_check(self) -> None:
        assert self.check is not None
        severity = {Verdict.GO: "info", Verdict.CAUTION: "info", Verdict.NO_GO: "warning"}[self.check.verdict]
        self._around.say("check", f"Sensor check: {self.check.verdict.value}. {self.check.summary}", severity)

    def _arm(self, ask: Ask) -> None:
        plan: TestPlan = ask.arguments["plan"]
        overrule = bool(ask.arguments.get("overrule"))
        no_go = self.check is not None and self.check.verdict is Verdict.NO_GO
        if self._zero_failed:
            text = f"Not armed: the zero that was asked for before failed. {self._zero_failed}"
            self._zero_failed = ""  # it has been said: the next order to arm is meant
            self._refuse(ask, text)
            return
        if no_go and not overrule:
            assert self.check is not None
            self._refuse(
                ask,
                f"Not armed: the sensor check says no-go. {self.check.summary} Mend and check again, or arm "
                "in spite of it (F5 again)",
            )
            return
        whole = plan.model_copy(
            update={
                "check": self.record_of_check(overruled=no_go),
                "zero_utc": str(self.tare.record.get("taken_utc", "")),
            }
        )
        try:
            begun = self._around.arm(whole)
        except RequestRefused as error:
            ask.done.set_exception(error)
            return
        begun.add_done_callback(lambda done: _pass_on(done, ask))


def _findings(check: SensorCheck) -> Iterator[CheckFinding]:
    for finding in check.rig_findings:
        yield CheckFinding(verdict=finding.verdict.value, text=finding.text)
    for channel in check.channels:
        if channel.findings:
            yield CheckFinding(channel=channel.channel_id, verdict=channel.verdict.value, text=channel.text)


def _pass_on(begun: Future[Path], ask: Ask) -> None:
    error = begun.exception()
    if error is not None:
        ask.done.set_exception(error)
    else:
        ask.done.set_result(("Armed and recording", {"journal": str(begun.result())}))

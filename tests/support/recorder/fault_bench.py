"""An acquisition process under test, what it says, and what its runs hold."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from daq_app.acquisition import AcquisitionClient, read_session_file
from daq_app.acquisition.messages.published import EventMessage, HealthMessage, Message, State, StateMessage
from daq_app.config import Rig
from daq_app.runfile import open_run, verify
from tests.support.recorder.marked_check import check_marked
from tests.support.recorder.processes import quick_context
from tests.support.recorder.saboteur import run_sabotaged

SPEED = 2
"""Speed of the simulated devices' clock: a buffer of 20 s lasts 10 s then, also on a busy machine."""
RATE_HZ = 4000
LIMIT_S = 120.0


def another_process(work: Callable[..., None], *arguments: object) -> Any:
    """Started; it can be killed."""
    process = quick_context().Process(target=work, args=arguments, daemon=True)
    process.start()
    return process


@dataclass
class Told:
    """What the operator heard first of a fault."""

    after_s: float
    severity: str
    text: str


@dataclass
class Heard:
    """All messages of one process with the time they came; any thread may wait for more."""

    changed: threading.Condition = field(default_factory=threading.Condition)
    messages: list[tuple[float, Message]] = field(default_factory=list)

    def add(self, message: Message) -> None:
        with self.changed:
            self.messages.append((time.monotonic(), message))
            self.changed.notify_all()

    def first(self, right: Callable[[Message], bool], since: int) -> tuple[float, Message] | None:
        return next((entry for entry in self.messages[since:] if right(entry[1])), None)

    def wait(self, right: Callable[[Message], bool], since: int, why: str) -> tuple[float, Message]:
        deadline = time.monotonic() + LIMIT_S
        with self.changed:
            while (found := self.first(right, since)) is None:
                left = deadline - time.monotonic()
                if left <= 0:
                    said = [
                        m.text for _, m in self.messages[since:] if isinstance(m, EventMessage | StateMessage)
                    ]
                    raise AssertionError(f"{why} was not heard; but: {said[-12:]}")
                self.changed.wait(min(left, 1.0))
        return found


class Acquisition:
    """The process, a viewer that may command, and a saboteur in it."""

    def __init__(self, rig_file: Path, rig: Rig, out: Path, connection: str, *options: str) -> None:
        self.rig, self.out, self.connection = rig, out, connection
        self.spare = out.with_name(f"{out.name}-spare")
        out.parent.mkdir(parents=True, exist_ok=True)
        heard, self._orders = quick_context().Pipe(duplex=False)
        arguments = [
            *("--rig", str(rig_file), "--out", str(out), "--spare", str(self.spare)),
            *("--connection", connection, *options),
        ]
        self.process = quick_context().Process(target=run_sabotaged, args=(arguments, heard))
        self.process.start()
        heard.close()
        session = None
        deadline = time.monotonic() + LIMIT_S
        while session is None or session.pid != self.process.pid:
            assert self.process.exitcode is None, f"ended with {self.process.exitcode}"
            assert time.monotonic() < deadline
            self.process.join(0.02)
            session = read_session_file(out)
        self.session = session
        self.client = AcquisitionClient(session.address, session.token, topics=(), timeout_s=LIMIT_S)
        self.heard = Heard()
        self._mark = 0
        self._struck_s = 0.0
        self._ending = threading.Event()
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def _listen(self) -> None:
        with AcquisitionClient(
            self.session.address, topics=("state", "health", "event"), timeout_s=LIMIT_S
        ) as ear:
            caught_up = False
            while not self._ending.is_set():
                received = ear.receive(0.1)
                if received is None:
                    continue
                self.heard.add(received.message)
                if not caught_up:  # what was said before the subscription arrived, as any viewer asks for it
                    caught_up = True
                    events = ear.request("hello", timeout_s=LIMIT_S).data["events"]
                    for event in events if isinstance(events, list) else ():
                        self.heard.add(EventMessage.model_validate(event))

    # -- a run ------------------------------------------------------------------------------------

    def state(self, *states: State) -> StateMessage:
        """Wait for one of the states, said after the last `arm` or `strike`."""

        def right(message: Message) -> bool:
            return isinstance(message, StateMessage) and message.state in states

        message = self.heard.wait(right, self._mark, f"state {states}")[1]
        assert isinstance(message, StateMessage)
        return message

    def arm(self, test: str = "FR1-L3-1") -> Path:
        """Sample (again), record, and wait until a thousand samples are safe; the journal's path."""
        self.mark()
        assert self.client.request("preview", timeout_s=LIMIT_S).ok
        if self.state(*State).state is State.FAILED:
            self.mark()
        self.heard.wait(
            lambda m: isinstance(m, HealthMessage) and m.buffer_samples > 0, self._mark, "samples"
        )
        reply = self.client.request("arm", timeout_s=LIMIT_S, test=test)
        if "recorded already" in reply.text:  # the wall was moved before, and nobody had armed
            self.client.request("stop", timeout_s=LIMIT_S)
            self.state(State.SAVED)
            self.mark()
            reply = self.client.request("arm", timeout_s=LIMIT_S, test=test)
        if not reply.ok:  # the hardware is open, and the session is about to hear of it
            assert "Nothing is being sampled" in reply.text, reply.text
            self.state(State.PREVIEWING)
            reply = self.client.request("arm", timeout_s=LIMIT_S, test=test)
            assert reply.ok, reply.text
        self.mark()
        self.record(1000)
        return Path(str(reply.data["journal"]))

    def mark(self) -> None:
        """What is heard from now on counts."""
        self._mark = len(self.heard.messages)

    @property
    def safe_sample(self) -> int:
        """The last that is acknowledged."""
        recent = [m for _, m in self.heard.messages[-200:] if isinstance(m, HealthMessage)]
        return recent[-1].acknowledged_sample if recent else 0

    def record(self, more: int) -> int:
        """Until so many more samples are safe on disk; the last one."""
        begin = len(self.heard.messages)
        first = self.heard.wait(lambda m: isinstance(m, HealthMessage) and m.recording, begin, "recording")[1]
        assert isinstance(first, HealthMessage)
        target = first.sample + more

        def right(message: Message) -> bool:
            return isinstance(message, HealthMessage) and message.acknowledged_sample >= target

        last = self.heard.wait(right, begin, f"sample {target} on disk")[1]
        assert isinstance(last, HealthMessage)
        return last.acknowledged_sample

    def sabotage(self, **orders: Any) -> None:
        """Break the machine under the process; nothing mends it."""
        self._orders.send(orders)

    def strike(self) -> None:
        """The fault happens now."""
        self.mark()
        self._struck_s = time.monotonic()

    def told(self, *words: str) -> Told:
        """The first event or failure since `strike` that has one of the words."""

        def right(message: Message) -> bool:
            if isinstance(message, StateMessage) and message.state is not State.FAILED:
                return False
            if not isinstance(message, EventMessage | StateMessage):
                return False
            return any(word in message.text for word in words)

        at, message = self.heard.wait(right, self._mark, f"'{words}'")
        severity = message.severity if isinstance(message, EventMessage) else "error"
        text = message.text if isinstance(message, EventMessage | StateMessage) else ""
        return Told(at - self._struck_s, severity, text)

    def told_in_all(self, *words: str) -> None:
        """Heard at any time since the process listens."""
        mark, self._mark = self._mark, 0
        self.told(*words)
        self._mark = mark

    def stop(self) -> StateMessage:
        """End the run as the operator does; its final state."""
        self.mark()
        reply = self.client.request("stop", timeout_s=LIMIT_S)
        assert reply.ok, reply.text
        return self.state(State.SAVED, State.FAILED)

    # -- the process ------------------------------------------------------------------------------

    def kill(self) -> None:
        self.process.kill()
        self._hang_up()

    def end(self) -> int:
        """In good order; the exit code."""
        self.sabotage()
        self.client.request("shutdown", timeout_s=LIMIT_S, force=1.0)
        self.process.join(LIMIT_S)
        self._hang_up()
        code = self.process.exitcode
        assert code is not None, "the process does not end"
        return code

    def _hang_up(self) -> None:
        self._ending.set()
        self._listener.join()
        self.client.close()
        self.process.join()


@dataclass
class Standing:
    """One acquisition for many tests in any order, begun again where one of them needed its chassis."""

    make: Callable[[], Acquisition]
    _now: Acquisition | None = None

    def living(self) -> Acquisition:
        if self._now is None or self._now.process.exitcode is not None:
            self._now = self.make()
        return self._now

    def end(self) -> None:
        """Free its chassis."""
        if self._now is not None and self._now.process.exitcode is None:
            assert self._now.end() == 0
        self._now = None


@dataclass
class RunFacts:
    """What a run says of itself, and what its samples say."""

    lost: int
    """Samples that a walk through the readings finds missing."""
    in_gap_table: int
    verdict: str
    reasons: list[str]
    end: int
    first: int
    account: str = field(default="", repr=False)
    """What the run itself says of gaps, driver, clock and machine: shown where a test fails."""


def look_at(
    path: Path | str,
    rig: Rig | None,
    lag: int | None = None,
    *,
    one_device: bool = True,
    clock_ppm: float = 0.0,
) -> RunFacts:
    """Verify a run and, on a marked line (`rig` given), show of every sample that it is the right one.

    `one_device`: the marks went on behind the gaps, so that they say how long each was; a server that was
    started anew begins its marks anew. `clock_ppm`: how much faster than it says the clock was made to run.
    """
    path = Path(path)
    report = verify(path)
    assert report.ok, report.problems
    missing = 0
    with open_run(path) as run:
        for start in range(0, run.n_samples, 40_000):
            window = run.readings(start=start, stop=min(start + 40_000, run.n_samples))
            missing += int((window != window).any(axis=0).sum())
        quality = run.derived.results.get("quality") if run.derived is not None else None
        quality = quality or {"verdict": "none", "reasons": []}
        first, end = run.first_sample, run.first_sample + run.n_samples
        gaps = [f"gap {gap.first_sample}+{gap.n_samples}: {gap.reason}" for gap in run.gaps]
        kinds = ("driver", "clock", "alarm", "disk", "recorder", "end")
        said = [f"{event.kind}@{event.sample}: {event.text}" for event in run.events if event.kind in kinds]
        account = "\n  ".join([f"{path.name}, {first} to {end}:", *gaps, *said])
    if rig is not None:
        marks = check_marked(path, rig, lag, SPEED, clock_ppm=clock_ppm)
        assert marks.unexplained == 0, f"{marks}\n{account}"
        assert not one_device or all(leap.explained for leap in marks.leaps), f"{marks.leaps}\n{account}"
    assert missing == report.lost_samples, f"samples lost and the table of gaps differ\n{account}"
    return RunFacts(missing, report.lost_samples, quality["verdict"], quality["reasons"], end, first, account)


Start = Callable[..., Acquisition]
"""Starts an acquisition of the test's own."""
Row = Callable[..., None]
"""Puts a line into the table of the faults."""

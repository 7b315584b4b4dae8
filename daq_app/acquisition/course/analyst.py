"""The analyst thread: what the samples mean, for the course of the test and for the viewers.

It comes after the recorder: whatever happens here, slow or wrong, the samples are on disk.
"""

from __future__ import annotations

import math
import queue
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from daq_app.acquisition.course.channel_watch import ChannelWatch
from daq_app.acquisition.course.judgement import PULLED, Situation, judge
from daq_app.acquisition.course.live import LiveView
from daq_app.acquisition.course.overload import OverloadWatch
from daq_app.acquisition.course.preparation import Preparation, Surroundings
from daq_app.acquisition.course.sequence import Change
from daq_app.acquisition.course.sequence import Sequence as Course
from daq_app.acquisition.course.tare import Tare
from daq_app.acquisition.messages.items import (
    Arrived,
    Ask,
    Begin,
    Closed,
    End,
    Item,
    Lost,
    Noted,
    RequestRefused,
    Saved,
    SourceEnded,
    Started,
)
from daq_app.acquisition.messages.published import (
    CheckMessage,
    EventMessage,
    Judgement,
    State,
    StateMessage,
)
from daq_app.acquisition.messages.publisher import Publisher
from daq_app.config.rig import Rig
from daq_app.rocking.motion.phases import PhaseEvent
from daq_app.runfile import TestPlan
from drivers import Block, Opened

_REPEAT_STATE_S: Final = 1.0
_SAME_RATE: Final = 1e-6
UNARMED: Final = "unarmed"
"""Stands for the test's name in the run of a release that nobody armed."""
_MOVING: Final = frozenset({State.RELEASED, State.ROCKING})


@dataclass(frozen=True, slots=True)
class Surrounding:
    """What the analyst asks of the session; all of it answers at once."""

    post: Callable[[Item], None]
    """Into the stream, by way of the recorder."""
    hurry: Callable[[bool], None]
    """Ask for samples in small pieces, from the release to the rest."""
    arm: Callable[[TestPlan, Tare], Future[Path]]
    """Begin to record a test; raises `RequestRefused`."""
    keep: Callable[[int, Tare], None]
    """Record the release at that sample, which nobody armed, from some time before it."""
    disk_safe: Callable[[], bool]
    """Whether samples of the run reach a disk."""
    free_bytes: Callable[[], int]
    """Room on the disk of the runs."""


class Analyst(threading.Thread):
    """Takes items from `inbox`, publishes, and posts events and ends back to the recorder."""

    def __init__(
        self,
        rig: Rig,
        publisher: Publisher,
        around: Surrounding,
        *,
        release_within_s: float,
        planned_rate_hz: float = 0.0,
    ) -> None:
        super().__init__(name="analyst", daemon=True)
        self.inbox: queue.SimpleQueue[Item | None] = queue.SimpleQueue()
        self.state = State.IDLE
        self.state_text = ""
        self.test = ""
        self.run_path = ""
        self.plan = TestPlan()
        """The test that is armed, or would be armed now."""
        self.overloaded: tuple[str, ...] = ()
        self._rig = rig
        self._publisher = publisher
        self._around = around
        self._release_within_s = release_within_s
        self._planned_rate_hz = planned_rate_hz
        self._opened: Opened | None = None
        self._live: LiveView | None = None
        self._overload: OverloadWatch | None = None
        self._channels: ChannelWatch | None = None
        self._sequence: Course | None = None
        self._sample = 0
        self._since = 0
        self._last_state_s = 0.0
        self._fault = ""
        self._standing: dict[str, EventMessage] = {}
        """What was wrong before arming and still is: every run must say it."""
        self._preparation: Preparation | None = None
        self._tare = Tare()
        """The zero of the last preparation, for whoever asks while nothing is sampled."""
        self._off_target = 0
        """Last sample at which the wall was outside the band of the plan."""
        self._aborted = False
        self._judgement = Judgement()

    def run(self) -> None:
        """Until None comes."""
        while True:
            try:
                item = self.inbox.get(timeout=_REPEAT_STATE_S)
            except queue.Empty:
                item = None
                self._repeat_state()
                continue
            if item is None:
                return
            try:
                self._take(item)
            except Exception as error:
                # A fault of ours must not end the thread that knows when the test is over.
                self._tell_fault(error)
            self._repeat_state()

    def _tell_fault(self, error: Exception) -> None:
        said = f"{type(error).__name__}: {error}"
        if said == self._fault:
            return
        self._fault = said
        self._note(
            "analysis",
            f"A step of the analysis failed ({said}). Recording goes on; stop by hand if the end of the test "
            "is not noticed, and please report this",
            "error",
        )

    def _take(self, item: Item) -> None:
        match item:
            case Arrived(block=block):
                self._on_block(block)
            case Lost():
                self._refuse_orders("samples were lost meanwhile; ask again")
            case Begin():
                self._on_begin(item)
            case Ask():
                self._on_ask(item)
            case Started(opened=opened):
                self._on_started(opened)
            case SourceEnded():
                self._on_source_ended(item)
            case Closed():
                self._sequence = None
                self._aborted = item.end.outcome == "aborted"
                self._new_live()
                self._go(State.SAVING, f"{item.end.text}. The run file is being made")
            case Saved():
                # The next test may be armed already: then its state is the one that matters.
                if self._sequence is None:
                    self.run_path = item.path
                    self._go(State.SAVED if item.ok else State.FAILED, item.text)
            case Noted(event=event):
                if event.kind == "clock" and event.data.get("clock") in ("rate", "planned_rate", "drift"):
                    self._standing[str(event.data["clock"])] = event
            case End():
                return

    # -- blocks ----------------------------------------------------------------------------------

    def _on_block(self, block: Block) -> None:
        self._sample = block.first_sample + block.n_samples
        if self._preparation is not None:
            self._preparation.take(block)
        if self._overload is not None:
            self.overloaded = self._overload.check(block)
            for kind, text in self._overload.news():
                self._note(kind, text, "warning")
        if self._channels is not None:
            # Impacts ring and leap by themselves: then only what cannot be motion is looked at.
            moving = self.state in _MOVING
            at_end = self._overload.at_end if self._overload is not None else frozenset()
            for doubt in self._channels.check(block, moving=moving, at_end=at_end):
                data: dict[str, float | str] = {"channel": doubt.channel_id, "doubt": doubt.name}
                self._note("channel", doubt.text, "warning", doubt.sample, data)
        if self._live is None:
            return
        # A backlog means that viewers are behind anyway: the newest matters, the test's course always.
        events = self._live.show(block, self.overloaded, quietly=self.inbox.qsize() > 20)
        if self._live.trouble:
            self._note("analysis", self._live.trouble, "error")
        if self._sequence is None:
            self._keep_unarmed(events)
        else:
            self._follow(self._sequence, events)
        self._judge()

    def _keep_unarmed(self, events: Sequence[PhaseEvent]) -> None:
        """A release that nobody armed is recorded all the same, from some time before it."""
        assert self._opened is not None
        moving = [event for event in events if event.kind in ("release", "impact")]
        if not moving or self._live is None:
            return
        self.test, self.run_path = UNARMED, ""
        course = Course(self._rig.acquisition, self._opened.rate_hz, self._sample, math.inf, armed=False)
        self._sequence = course
        self._around.keep(round(moving[0].sample), self.tare)
        self._follow(course, events[events.index(moving[0]) :])

    def _follow(self, course: Course, events: Sequence[PhaseEvent]) -> None:
        for event in events:
            if event.kind == "impact":
                self._note("impact", event.text, "info", round(event.sample), {"sample": event.sample})
        for change in course.advance(events, self._sample):
            if isinstance(change, Change):
                loud = change.state is State.RELEASED and not course.armed
                self._note(change.state.value, change.text, "error" if loud else "info", change.sample)
                self._go(change.state, change.text, change.sample)
            else:
                self._finish(change)
                return

    def _finish(self, end: End) -> None:
        self._sequence = None
        self._around.post(end)

    # -- course of a session ---------------------------------------------------------------------

    def _on_started(self, opened: Opened) -> None:
        self._opened = opened
        self._sample = 0
        surroundings = Surroundings(
            free_bytes=self._around.free_bytes,
            arm=lambda plan: self._around.arm(plan, self.tare),
            say=self._note,
        )
        self._preparation = Preparation(self._rig, opened, self._planned_rate_hz, surroundings)
        self._preparation.tare = self._tare
        self._overload = OverloadWatch(self._rig.channels, opened.ranges)
        self._channels = ChannelWatch(self._rig, opened.rate_hz, opened.ranges)
        self._standing = {}
        planned = self._planned_rate_hz
        if planned and abs(opened.rate_hz / planned - 1.0) > _SAME_RATE:
            text = (
                f"The hardware samples at {opened.rate_hz:g} Hz where {planned:g} Hz were planned. Times "
                "use the rate that was read back. Check that the modules are the ones of the rig file"
            )
            self._note("clock", text, "warning", data={"clock": "planned_rate", "value": opened.rate_hz})
        self._new_live()
        self._go(State.PREVIEWING, f"Sampling at {opened.rate_hz:g} Hz")

    def _new_live(self) -> None:
        if self._opened is not None:
            self._live = LiveView(self._rig, self._opened.rate_hz, self.tare.readings, self._publisher)
            self._off_target = self._sample

    def _on_begin(self, begin: Begin) -> None:
        assert self._opened is not None
        self.run_path = ""
        self._aborted = False
        if begin.kept:
            self._tell_standing()
            return
        self.test = begin.header.test
        self.plan = begin.header.test_plan or TestPlan(test=self.test)
        self._note("armed", f"Armed for {self.test}", "info")
        self._tell_standing()
        if self._sequence is not None:
            # The release came a moment before the order: it is this test's, and the run has it whole.
            self._sequence.arm(self._sample)
            self._go(self.state, f"Armed for {self.test} a moment after its release", self._since)
            return
        self._sequence = Course(
            self._rig.acquisition, self._opened.rate_hz, self._sample, self._release_within_s
        )
        self._go(State.ARMED, f"Armed for {self.test}; recording", self._sample)
        held = self._live.held_since if self._live is not None else None
        if held is not None:
            self._follow(self._sequence, [PhaseEvent("hold", held, self._sample, 0.0, "held still already")])

    def _tell_standing(self) -> None:
        """Whatever is wrong now has been told before; this run must say it as well."""
        for event in self._standing.values():
            self._note(event.kind, event.text, event.severity, data=event.data)
        for watch in (self._overload, self._channels):
            if watch is not None:
                watch.forget()

    def _on_source_ended(self, ended: SourceEnded) -> None:
        self._refuse_orders("the acquisition has stopped")
        self._tare = self.tare
        self._opened = self._live = self._overload = self._channels = self._preparation = None
        if ended.error is not None:
            self._note("driver", str(ended.error), "error")
        if self._sequence is not None:
            outcome, text = (
                ("failed", str(ended.error)) if ended.error else ("stopped", "The acquisition was stopped")
            )
            self._finish(End("failed" if outcome == "failed" else "stopped", self._sample, text))
        elif ended.error is not None:
            self._go(State.FAILED, str(ended.error))
        elif self.state is not State.SAVED:
            self._go(State.IDLE, "Not sampling")

    # -- requests --------------------------------------------------------------------------------

    def _on_ask(self, ask: Ask) -> None:
        try:
            if ask.name in ("tare", "check", "pull", "arm"):
                self._prepare(ask)
                return
            ask.done.set_result(self._answer(ask))
        except RequestRefused as error:
            ask.done.set_exception(error)

    def _answer(self, ask: Ask) -> tuple[str, dict[str, Any]]:
        match ask.name:
            case "plan":
                if self._sequence is not None:
                    raise RequestRefused(
                        f"{self.test} is being recorded: its plan is locked. Choose the next test after it"
                    )
                self.plan = ask.arguments["plan"]
                self._judge(force=True)
                return f"{self.plan.test or 'No test'} is chosen", {}
            case "stop":
                sequence = self._recording()
                self._finish(sequence.end("stopped", self._sample, "Stopped by the operator"))
                return "Stopped; the run is being saved", {}
            case "abort":
                sequence = self._recording()
                if not sequence.before_release:
                    raise RequestRefused(
                        "The wall has been released: the test counts. Use stop to end the recording now"
                    )
                self._finish(sequence.end("aborted", self._sample, "Aborted by the operator before release"))
                return "Aborted; what was recorded is kept as an aborted run", {}
            case "marker" | "note":
                text = str(ask.arguments.get("text", "")).strip() or ask.name
                self._note(ask.name, text[:2000], "info")
                return f"{ask.name} at sample {self._sample}", {"sample": self._sample}
        raise RequestRefused(f"There is no request '{ask.name}'")

    def _recording(self) -> Course:
        if self._sequence is None:
            raise RequestRefused("No test is being recorded")
        return self._sequence

    @property
    def tare(self) -> Tare:
        """The zero in force."""
        return self._preparation.tare if self._preparation is not None else self._tare

    @property
    def sample(self) -> int:
        """Samples that have been looked at."""
        return self._sample

    @property
    def upright(self) -> bool:
        """Whether the wall stands upright, as far as is known."""
        rotation = self._live.rotation_rad if self._live is not None else math.nan
        return self._judgement.ratio is None or abs(rotation) < PULLED * self._rig.specimen.alpha0_rad

    @property
    def check_message(self) -> CheckMessage:
        """The sensor check in force."""
        return CheckMessage(check=self._preparation.check if self._preparation is not None else None)

    def _prepare(self, ask: Ask) -> None:
        if self._preparation is None:
            raise RequestRefused("Nothing is being sampled; start the preview first")
        ask.done.add_done_callback(lambda _done: self._after_preparation(ask.name))
        self._preparation.order(ask, recording=self._sequence is not None)

    def _after_preparation(self, name: str) -> None:
        """On this thread: an order has been carried out, or refused."""
        if name == "tare" and self._sequence is None:
            self._new_live()
        if name in ("check", "pull"):
            self._publisher.send("check", self.check_message)

    def _refuse_orders(self, why: str) -> None:
        if self._preparation is not None:
            self._preparation.refuse_all(why)

    # -- saying ----------------------------------------------------------------------------------

    def _note(
        self,
        kind: str,
        text: str,
        severity: str,
        sample: int | None = None,
        data: dict[str, float | str] | None = None,
    ) -> None:
        """Into the journal and to the viewers, by way of the recorder."""
        event = EventMessage.model_validate(
            {
                "kind": kind,
                "sample": self._sample if sample is None else sample,
                "text": text,
                "severity": severity,
                "data": data or {},
            }
        )
        self._around.post(Noted(event))

    def _go(self, state: State, text: str, since: int | None = None) -> None:
        self.state, self.state_text = state, text
        self._around.hurry(state in _MOVING)
        self._since = self._sample if since is None else since
        self._judge(force=True)

    def _judge(self, *, force: bool = False) -> None:
        """Publish the judgement where one of its words has changed."""
        judgement = judge(self._situation(), self._rig.acquisition)
        before, self._judgement = self._judgement, judgement
        figures = {"ratio": None, "held_s": 0.0}
        if force or judgement.model_copy(update=figures) != before.model_copy(update=figures):
            self._last_state_s = 0.0
            self._repeat_state()

    def _situation(self) -> Situation:
        course, live, opened = self._sequence, self._live, self._opened
        rotation = live.rotation_rad if live is not None else math.nan
        alpha = self._rig.specimen.alpha0_rad
        band = self.plan.band or (0.0, math.inf)
        if not band[0] <= abs(rotation) / alpha <= band[1]:
            self._off_target = self._sample
        held_since = live.held_since if live is not None else None
        steady = held_since is not None and opened is not None
        held_s = 0.0
        if held_since is not None and opened is not None:
            held_s = max(0.0, (self._sample - max(held_since, self._off_target)) / opened.rate_hz)
        return Situation(
            state=self.state,
            sampling=opened is not None,
            armed=course is not None and course.armed,
            plan=self.plan,
            rotation_rad=rotation,
            alpha_rad=alpha,
            steady=steady,
            held_s=held_s,
            disk_safe=self._around.disk_safe(),
            aborted=self._aborted,
            text=self.state_text,
        )

    def _repeat_state(self) -> None:
        """On every change and once a second: a viewer that has just come knows at once."""
        now = time.monotonic()
        if now - self._last_state_s < _REPEAT_STATE_S:
            return
        self._last_state_s = now
        self._publisher.send("state", self.state_message())

    def state_message(self) -> StateMessage:
        """The state as viewers see it."""
        course = self._sequence
        return StateMessage(
            state=self.state,
            test=self.test,
            run_path=self.run_path,
            text=self.state_text,
            since_sample=self._since,
            sample=self._sample,
            armed=course is not None and course.armed,
            plan=self.plan,
            locked=course is not None,
            judgement=self._judgement,
        )

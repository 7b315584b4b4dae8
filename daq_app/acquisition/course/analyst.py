"""The analyst thread: what the samples mean, for the course of the test and for the viewers.

It comes after the recorder: whatever happens here, slow or wrong, the samples are on disk.
"""

from __future__ import annotations

import contextlib
import math
import queue
import threading
from collections.abc import Sequence
from functools import partial
from typing import Final

from daq_app.acquisition.course.clock_warnings import ClockWarnings, unplanned_rate
from daq_app.acquisition.course.ended_runs import EndedRuns
from daq_app.acquisition.course.live import LiveView
from daq_app.acquisition.course.orders import Orders
from daq_app.acquisition.course.preparation import Preparation, Surroundings
from daq_app.acquisition.course.sensors.sensor_news import SensorNews
from daq_app.acquisition.course.sequence import Change
from daq_app.acquisition.course.sequence import Sequence as Course
from daq_app.acquisition.course.surrounding import Surrounding
from daq_app.acquisition.course.tare import Tare
from daq_app.acquisition.course.unarmed import SETTLE_S, from_the_release, gives_way
from daq_app.acquisition.course.voice.hold_clock import HoldClock
from daq_app.acquisition.course.voice.judgement import PULLED, Situation
from daq_app.acquisition.course.voice.state_voice import REPEAT_S, StateVoice
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
from daq_app.acquisition.messages.published import UNARMED, CheckMessage, EventMessage, State
from daq_app.acquisition.messages.publisher import Publisher
from daq_app.config.rig import Rig
from daq_app.rocking.motion.phases import PhaseEvent
from daq_app.runfile import TestPlan
from daq_app.short_memory import until_memory
from drivers import Block, Opened

_MOVING: Final = frozenset({State.RELEASED, State.ROCKING})


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
        self.voice = StateVoice(publisher, rig.acquisition)
        self._rig = rig
        self._publisher = publisher
        self._around = around
        self._release_within_s = release_within_s
        self._planned_rate_hz = planned_rate_hz
        self._opened: Opened | None = None
        self._live: LiveView | None = None
        self._sensors: SensorNews | None = None
        self._sequence: Course | None = None
        self._ended = EndedRuns()
        self._moves_on = False
        """Whether what the wall does still belongs to the course that was ended last."""
        self._fault = ""
        self._clock = ClockWarnings()
        self._preparation: Preparation | None = None
        self._tare = Tare()
        """The zero of the last preparation, for whoever asks while nothing is sampled."""
        self._hold = HoldClock()
        self._aborted = False
        self._orders = Orders(
            self.voice,
            finish=self._finish,
            judge=lambda: self._judge(force=True),
            note=lambda kind, text: self._note(kind, text, "info"),
        )

    def run(self) -> None:
        """Until None comes."""
        while True:
            try:
                item = self.inbox.get(timeout=REPEAT_S)
            except queue.Empty:
                with contextlib.suppress(MemoryError):
                    self._judge(force=True)
                continue
            if item is None:
                return
            # Neither a fault of ours nor want of memory must end the thread that knows when the test is over.
            with contextlib.suppress(MemoryError):
                try:
                    self._take(item)
                except Exception as error:
                    self._tell_fault(error)
                self.voice.repeat()

    def _tell_fault(self, error: Exception) -> None:
        if (fault := f"{type(error).__name__}: {error}") == self._fault:
            return
        self._fault = fault
        self._note(
            "analysis",
            f"A step of the analysis failed ({fault}). Recording goes on; stop by hand if the end of the "
            "test is not noticed, and please report this",
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
                self._on_closed(item.end)
            case Saved():
                self._ended.save()
                until_memory(partial(self._on_saved, item))  # somebody waits for it
            case Noted(event=event):
                self._clock.take(event)

    # -- blocks ----------------------------------------------------------------------------------

    def _on_block(self, block: Block) -> None:
        self.voice.sample = block.first_sample + block.n_samples
        if self._live is None or self._preparation is None or self._sensors is None:
            return
        events = self._live.analyse(block)  # first: somebody waits for r
        self._preparation.take(block)
        self._sensors.look(block, moving=self.state in _MOVING)
        # A backlog means that viewers are behind anyway: the newest matters, the test's course always.
        if self.inbox.qsize() <= 20:
            self._live.publish_block(block, self.overloaded)
        if self._live.trouble:
            self._note("analysis", self._live.trouble, "error")
        if self._sequence is not None:
            self._follow(self._sequence, events)
        elif not self._moves_on:
            self._keep_unarmed(events)
        elif not self._live.moves:
            self._new_live()  # a disk may keep the journal open for long, and no release waits for it
        self._judge()

    def _keep_unarmed(self, events: Sequence[PhaseEvent]) -> None:
        """A release that nobody armed is recorded all the same, from some time before it."""
        moving = from_the_release(events, doubtful=self._sensors_fail())
        if not moving or self._opened is None:
            return
        self.voice.test, self.voice.run_path = UNARMED, ""
        course = Course(self._rig.acquisition, self._opened.rate_hz, self.voice.sample, math.inf, armed=False)
        self._sequence = course
        self._around.keep(round(moving[0].sample), self.tare)
        self._follow(course, moving)

    def _sensors_fail(self) -> bool:
        """Whether a rail is reached, or something new has been wrong with a sensor within `SETTLE_S`."""
        assert self._opened is not None and self._sensors is not None
        quiet = self.voice.sample - self._sensors.told_sample
        return bool(self.overloaded) or quiet < SETTLE_S * self._opened.rate_hz

    @property
    def gives_way(self) -> bool:
        """Whether a test may be armed now."""
        return self._opened is None or gives_way(self._sequence, self.voice.sample, self._opened.rate_hz)

    def _follow(self, course: Course, events: Sequence[PhaseEvent]) -> None:
        for event in events:
            if event.kind == "impact":
                self._note("impact", event.text, "info", round(event.sample), {"sample": event.sample})
        for change in course.advance(events, self.voice.sample):
            if isinstance(change, Change):
                loud = change.state is State.RELEASED and not course.armed
                self._note(change.state.value, change.text, "error" if loud else "info", change.sample)
                self._go(change.state, change.text, change.sample)
            else:
                self._finish(change)
                return

    def _finish(self, end: End) -> None:
        self._sequence = None
        self._ended.end()
        self._moves_on = self._live is not None and self._live.released
        self._around.post(end)

    def _on_saved(self, saved: Saved) -> None:
        # The next test may be armed already, or be over and about to be saved: its state is what matters.
        if self._sequence is None and self._ended.all_saved:
            self.voice.run_path = saved.path
            self._go(State.SAVED if saved.ok else State.FAILED, saved.text)

    def _on_closed(self, end: End) -> None:
        """A journal is closed; one that had to wait for a disk may be older than the course of now."""
        if not self._ended.close():
            self._sequence = None  # the recorder gave the run up
        if self._sequence is None:
            self._aborted = end.outcome == "aborted"
            if self._moves_on:
                self._new_live()
            self._go(State.SAVING, f"{end.text}. The run file is being made")

    # -- course of a session ---------------------------------------------------------------------

    def _on_started(self, opened: Opened) -> None:
        self._opened = opened
        self.voice.sample = 0
        surroundings = Surroundings(
            free_bytes=self._around.free_bytes,
            arm=lambda plan: self._around.arm(plan, self.tare),
            say=self._note,
        )
        self._preparation = Preparation(self._rig, opened, self._planned_rate_hz, surroundings)
        self._preparation.tare = self._tare
        self._sensors = SensorNews(self._rig, opened, self._note)
        self._clock.forget()
        if text := unplanned_rate(opened.rate_hz, self._planned_rate_hz):
            self._note("clock", text, "warning", data={"clock": "planned_rate", "value": opened.rate_hz})
        self._new_live()
        self._go(State.PREVIEWING, f"Sampling at {opened.rate_hz:g} Hz")

    def _new_live(self) -> None:
        self._moves_on = False
        if self._opened is not None:
            self._live = LiveView(self._rig, self._opened.rate_hz, self.tare.readings, self._publisher)
            self._hold.restart(self.voice.sample)

    def _on_begin(self, begin: Begin) -> None:
        assert self._opened is not None
        self.voice.run_path, self._aborted = "", False
        if begin.kept:
            self._tell_standing()
            return
        self.voice.test = begin.header.test
        self.voice.plan = begin.header.test_plan or TestPlan(test=begin.header.test)
        self._note("armed", f"Armed for {self.voice.test}", "info")
        self._tell_standing()
        if self._sequence is not None:
            # The release came a moment before the order: it is this test's, and the run has it whole.
            self._sequence.arm(self.voice.sample)
            self._go(self.state, f"Armed for {self.voice.test} a moment after its release", self.voice.since)
            return
        self._sequence = Course(
            self._rig.acquisition, self._opened.rate_hz, self.voice.sample, self._release_within_s
        )
        self._go(State.ARMED, f"Armed for {self.voice.test}; recording", self.voice.sample)
        if self._live is not None and (held := self._live.held_since) is not None:
            self._follow(
                self._sequence, [PhaseEvent("hold", held, self.voice.sample, 0.0, "held still already")]
            )

    def _tell_standing(self) -> None:
        """Whatever is wrong now has been told before; this run must say it as well."""
        for event in self._clock.standing:
            self._note(event.kind, event.text, event.severity, data=event.data)
        if self._sensors is not None:
            self._sensors.forget()

    def _on_source_ended(self, ended: SourceEnded) -> None:
        self._refuse_orders("the acquisition has stopped")
        self._tare = self.tare
        self._opened = self._live = self._sensors = self._preparation = None
        if ended.error is not None:
            self._note("driver", str(ended.error), "error")
        if self._sequence is not None:
            at, error = self.voice.sample, ended.error
            stopped = End("stopped", at, "The acquisition was stopped")
            self._finish(stopped if error is None else End("failed", at, str(error)))
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
            ask.done.set_result(self._orders.answer(ask, self._sequence))
        except RequestRefused as error:
            ask.done.set_exception(error)

    @property
    def tare(self) -> Tare:
        """The zero in force."""
        return self._preparation.tare if self._preparation is not None else self._tare

    @property
    def upright(self) -> bool:
        """Whether the wall stands upright, as far as is known."""
        rotation = self._live.rotation_rad if self._live is not None else math.nan
        return self.voice.judgement.ratio is None or abs(rotation) < PULLED * self._rig.specimen.alpha0_rad

    @property
    def check_message(self) -> CheckMessage:
        """The sensor check in force."""
        return CheckMessage(check=self._preparation.check if self._preparation is not None else None)

    def _prepare(self, ask: Ask) -> None:
        if self._preparation is None:
            raise RequestRefused("Nothing is being sampled; start the preview first")
        if ask.name == "arm" and self.gives_way and self._sequence is not None:
            words = "No impact followed, so this was no release; a test is armed now"
            self._finish(self._sequence.end("stopped", self.voice.sample, words))
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
        at = self.voice.sample if sample is None else sample
        told = {"kind": kind, "sample": at, "text": text, "severity": severity, "data": data or {}}
        self._around.post(Noted(EventMessage.model_validate(told)))

    def _go(self, state: State, text: str, since: int | None = None) -> None:
        self.voice.enter(state, text, since)
        self._around.hurry(state in _MOVING)
        self._judge(force=True)

    def _judge(self, *, force: bool = False) -> None:
        """Publish the judgement where one of its words has changed."""
        self.voice.judge(self._situation(), locked=self._sequence is not None, force=force)

    def _situation(self) -> Situation:
        course, live, opened = self._sequence, self._live, self._opened
        rotation = live.rotation_rad if live is not None else math.nan
        alpha = self._rig.specimen.alpha0_rad
        held_since = live.held_since if live is not None else None
        self._hold.look(self.voice.sample, abs(rotation) / alpha, self.voice.plan.band)
        return Situation(
            state=self.state,
            sampling=opened is not None,
            opening=self._around.opening(),
            silent=self._around.silent(),
            armed=course is not None and course.armed,
            plan=self.voice.plan,
            rotation_rad=rotation,
            alpha_rad=alpha,
            steady=held_since is not None,
            goes_back=live is not None and live.goes_back,
            held_s=self._hold.held_s(held_since, opened.rate_hz) if opened is not None else 0.0,
            disk_safe=self._around.disk_safe(),
            aborted=self._aborted,
            text=self.voice.text,
        )

    @property
    def overloaded(self) -> tuple[str, ...]:
        """Channels that can follow no further now."""
        return self._sensors.overloaded if self._sensors is not None else ()

    @property
    def state(self) -> State:
        return self.voice.state

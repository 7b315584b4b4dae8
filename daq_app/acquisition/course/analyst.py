"""The analyst thread: what the samples mean, for the course of the test and for the viewers.

It comes after the recorder: whatever happens here, slow or wrong, the samples are on disk.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from daq_app.acquisition.course.channel_watch import ChannelWatch
from daq_app.acquisition.course.live import LiveView
from daq_app.acquisition.course.overload import OverloadWatch
from daq_app.acquisition.course.sequence import Change, Sequence
from daq_app.acquisition.course.tare import NotSteady, Tare, take_tare
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
from daq_app.acquisition.messages.published import EventMessage, State, StateMessage
from daq_app.acquisition.messages.publisher import Publisher
from daq_app.config.rig import Rig
from drivers import Block, Opened

_REPEAT_STATE_S: Final = 1.0
_TARE_S: Final = 1.0
_SAME_RATE: Final = 1e-6
_MOVING: Final = frozenset({State.RELEASED, State.ROCKING})


class Analyst(threading.Thread):
    """Takes items from `inbox`, publishes, and posts events and ends back to the recorder."""

    def __init__(
        self,
        rig: Rig,
        publisher: Publisher,
        post: Callable[[Item], None],
        hurry: Callable[[bool], None],
        *,
        release_within_s: float,
        planned_rate_hz: float = 0.0,
    ) -> None:
        """`hurry(True)` asks for samples in small pieces, from the release to the rest; it must not block."""
        super().__init__(name="analyst", daemon=True)
        self.inbox: queue.SimpleQueue[Item | None] = queue.SimpleQueue()
        self.state = State.IDLE
        self.state_text = ""
        self.test = ""
        self.run_path = ""
        self.tare = Tare()
        self.overloaded: tuple[str, ...] = ()
        self._rig = rig
        self._publisher = publisher
        self._post = post
        self._hurry = hurry
        self._release_within_s = release_within_s
        self._planned_rate_hz = planned_rate_hz
        self._opened: Opened | None = None
        self._live: LiveView | None = None
        self._overload: OverloadWatch | None = None
        self._channels: ChannelWatch | None = None
        self._sequence: Sequence | None = None
        self._sample = 0
        self._since = 0
        self._last_state_s = 0.0
        self._fault = ""
        self._standing: dict[str, EventMessage] = {}
        """What was wrong before arming and still is: every run must say it."""
        self._collecting: tuple[Ask, list[NDArray[np.float64]], int] | None = None

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
                self._refuse_tare("samples were lost meanwhile; ask again")
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
        if self._collecting is not None:
            self._collect(block)
        if self._overload is not None:
            self.overloaded = self._overload.check(block)
            if text := self._overload.news():
                self._note("overload", text, "warning")
        if self._channels is not None:
            # Impacts ring and leap by themselves: then only what cannot be motion is looked at.
            moving = self.state in _MOVING
            for doubt in self._channels.check(block, moving=moving):
                data: dict[str, float | str] = {"channel": doubt.channel_id, "doubt": doubt.name}
                self._note("channel", doubt.text, "warning", doubt.sample, data)
        if self._live is None:
            return
        # A backlog means that viewers are behind anyway: the newest matters, the test's course always.
        events = self._live.show(block, self.overloaded, quietly=self.inbox.qsize() > 20)
        if self._live.trouble:
            self._note("analysis", self._live.trouble, "error")
        if self._sequence is None:
            return
        for event in events:
            if event.kind == "impact":
                self._note("impact", event.text, "info", round(event.sample), {"sample": event.sample})
        for change in self._sequence.advance(events, self._sample):
            if isinstance(change, Change):
                self._note(change.state.value, change.text, "info", change.sample)
                self._go(change.state, change.text, change.sample)
            else:
                self._finish(change)
                return

    def _finish(self, end: End) -> None:
        self._sequence = None
        self._post(end)

    # -- course of a session ---------------------------------------------------------------------

    def _on_started(self, opened: Opened) -> None:
        self._opened = opened
        self._sample = 0
        self._overload = OverloadWatch(self._rig.channel_ids, opened.ranges)
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
        assert self._opened is not None
        self._live = LiveView(self._rig, self._opened.rate_hz, self.tare.readings, self._publisher)

    def _on_begin(self, begin: Begin) -> None:
        assert self._opened is not None
        self.test = begin.header.test
        self.run_path = ""
        self._new_live()
        self._sequence = Sequence(
            self._rig.acquisition, self._opened.rate_hz, self._sample, self._release_within_s
        )
        self._note("armed", f"Armed for {self.test}", "info")
        for event in self._standing.values():
            self._note(event.kind, event.text, event.severity, data=event.data)
        # Whatever is wrong with a channel now has been told before; this run must say it as well.
        for watch in (self._overload, self._channels):
            if watch is not None:
                watch.forget()
        self._go(State.ARMED, f"Armed for {self.test}; recording", self._sample)

    def _on_source_ended(self, ended: SourceEnded) -> None:
        self._refuse_tare("the acquisition has stopped")
        self._opened = self._live = self._overload = self._channels = None
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
            if ask.name == "tare":
                self._begin_tare(ask)
                return
            ask.done.set_result(self._answer(ask))
        except RequestRefused as error:
            ask.done.set_exception(error)

    def _answer(self, ask: Ask) -> tuple[str, dict[str, Any]]:
        match ask.name:
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

    def _recording(self) -> Sequence:
        if self._sequence is None:
            raise RequestRefused("No test is being recorded")
        return self._sequence

    def _begin_tare(self, ask: Ask) -> None:
        if self._opened is None:
            raise RequestRefused("Nothing is being sampled; start the preview first")
        if self._sequence is not None:
            raise RequestRefused("A test is being recorded: its zero cannot change now")
        if self._collecting is not None:
            raise RequestRefused("The zero is being taken already")
        seconds = float(ask.arguments.get("seconds", _TARE_S))
        if not 0.2 <= seconds <= 60.0:
            raise RequestRefused(f"The zero is taken over 0.2 to 60 s, not {seconds:g} s")
        self._collecting = (ask, [], round(seconds * self._opened.rate_hz))

    def _collect(self, block: Block) -> None:
        assert self._collecting is not None and self._opened is not None
        ask, blocks, wanted = self._collecting
        blocks.append(block.readings)
        if sum(part.shape[1] for part in blocks) < wanted:
            return
        self._collecting = None
        readings = np.concatenate(blocks, axis=1)[:, :wanted]
        resolution = np.array(
            [(high - low) / 2**16 for low, high in (self._opened.ranges[i] for i in self._rig.channel_ids)]
        )
        try:
            self.tare = take_tare(self._rig, readings, self._sample - readings.shape[1], resolution)
        except NotSteady as error:
            ask.done.set_exception(RequestRefused(str(error)))
            return
        self._new_live()
        self._note("tare", f"Zero taken over {wanted} samples", "info")
        ask.done.set_result(("The zero has been taken", {"tare": self.tare.readings}))

    def _refuse_tare(self, why: str) -> None:
        if self._collecting is not None:
            self._collecting[0].done.set_exception(RequestRefused(f"The zero could not be taken: {why}"))
            self._collecting = None

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
        self._post(Noted(event))

    def _go(self, state: State, text: str, since: int | None = None) -> None:
        self.state, self.state_text = state, text
        self._hurry(state in _MOVING)
        self._since = self._sample if since is None else since
        self._last_state_s = 0.0
        self._repeat_state()

    def _repeat_state(self) -> None:
        """On every change and once a second: a viewer that has just come knows at once."""
        now = time.monotonic()
        if now - self._last_state_s < _REPEAT_STATE_S:
            return
        self._last_state_s = now
        self._publisher.send("state", self.state_message())

    def state_message(self) -> StateMessage:
        """The state as viewers see it."""
        return StateMessage(
            state=self.state,
            test=self.test,
            run_path=self.run_path,
            text=self.state_text,
            since_sample=self._since,
            sample=self._sample,
        )

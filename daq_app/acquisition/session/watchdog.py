"""Looks five times a second whether samples arrive and reach the disk, and says so when they do not."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from daq_app.acquisition.course.preflight import LOW_SPACE_BYTES
from daq_app.acquisition.messages.published import EventMessage, HealthMessage
from daq_app.acquisition.pipeline.reader import SILENCE_S, Reader
from daq_app.acquisition.pipeline.recorder import Recorder
from daq_app.acquisition.session.machine_watch import MachineWatch

_SPACE_EVERY_S: Final = 0.5


@dataclass
class Watchdog:
    """Makes the health message; `say` takes an event when something begins or ends to be wrong."""

    recorder: Recorder
    folder: Path
    say: Callable[[EventMessage], None]
    clock: Callable[[], float] = time.monotonic
    machine: MachineWatch = field(default_factory=MachineWatch)
    _alarms: set[str] = field(default_factory=set)
    _acknowledged: int = 0
    _acknowledged_s: float = 0.0
    free_bytes: int = -1
    """Room on the disk of the runs when it was last looked at; negative before."""
    _space_s: float = -1e9

    def look(self, reader: Reader | None, overloaded: tuple[str, ...]) -> HealthMessage:
        """Judge the present state; call it five times a second."""
        status = self.recorder.status
        self._look_at_space(status.recording)
        self._look_at_machine(status.sample)
        if reader is not None and reader.is_alive() and reader.buffer_samples:
            self._alarm(
                "silence",
                reader.silent,
                "No samples for a second. Check chassis, network and sample clock; reading is tried again",
                "Samples arrive again",
            )
        else:
            self._alarms.discard("silence")
        self._look_at_disk(status.recording, status.acknowledged_sample, status.waiting_bytes)
        return HealthMessage(
            sample=reader.next_sample if reader is not None else status.sample,
            acknowledged_sample=status.acknowledged_sample if status.recording else 0,
            recording=status.recording,
            backlog_samples=reader.backlog_samples if reader is not None else 0,
            buffer_samples=reader.buffer_samples if reader is not None else 0,
            gaps=status.gaps,
            lost_samples=status.lost_samples,
            overloaded=overloaded,
            file_bytes=status.file_bytes,
            free_bytes=max(0, self.free_bytes),
            block_to_disk_ms_p99=self.recorder.latency.percentile_ms(99),
        )

    def _look_at_machine(self, sample: int) -> None:
        for news in self.machine.look():
            data: dict[str, float | str] = {"alarm": news.name, "value": news.value}
            self.say(
                EventMessage(kind="alarm", sample=sample, text=news.text, severity=news.severity, data=data)
            )

    def _look_at_disk(self, recording: bool, acknowledged: int, waiting_bytes: int) -> None:
        now = self.clock()
        if not recording or acknowledged != self._acknowledged:
            self._acknowledged, self._acknowledged_s = acknowledged, now
        late = recording and now - self._acknowledged_s > SILENCE_S and "silence" not in self._alarms
        self._alarm(
            "unsaved",
            late,
            f"Nothing has reached the disk for a second ({waiting_bytes / 1e6:.0f} MB wait in memory). "
            "Close programs that use this disk, and check its space",
            "Samples reach the disk again",
        )

    def _look_at_space(self, recording: bool) -> None:
        now = self.clock()
        if now - self._space_s < _SPACE_EVERY_S:
            return
        self._space_s = now
        try:
            self.free_bytes = shutil.disk_usage(self.folder).free
        except OSError:
            self.free_bytes = 0
        self._alarm(
            "space",
            self.free_bytes < LOW_SPACE_BYTES,
            f"Only {self.free_bytes / 1e6:.0f} MB are free in {self.folder}. Free space now"
            + ("; the test is still being recorded" if recording else ""),
            "There is room on the disk again",
        )

    def _alarm(self, name: str, wrong: bool, begins: str, ends: str) -> None:
        if wrong == (name in self._alarms):
            return
        status = self.recorder.status
        if wrong:
            self._alarms.add(name)
        else:
            self._alarms.discard(name)
        self.say(
            EventMessage(
                kind="alarm",
                sample=status.sample,
                text=begins if wrong else ends,
                severity="error" if wrong else "info",
                data={"alarm": name},
            )
        )

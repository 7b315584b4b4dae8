"""One session at the rig: wires the threads together and answers the requests of viewers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, TypeVar

from daq_app.acquisition.closing.finaliser import Finaliser, Finished
from daq_app.acquisition.closing.freed_memory import give_back, renew_reserve
from daq_app.acquisition.closing.result_maker import ResultMaker
from daq_app.acquisition.course.analyst import Analyst
from daq_app.acquisition.course.header import make_header
from daq_app.acquisition.course.preflight import check_name, check_space
from daq_app.acquisition.course.surrounding import Surrounding
from daq_app.acquisition.course.tare import Tare
from daq_app.acquisition.course.unarmed import KEPT_BEFORE_S
from daq_app.acquisition.messages.items import (
    Ask,
    Begin,
    Closed,
    Item,
    Noted,
    RequestRefused,
    Saved,
    SourceEnded,
    Started,
)
from daq_app.acquisition.messages.published import UNARMED, EventMessage, State
from daq_app.acquisition.messages.publisher import Publisher
from daq_app.acquisition.pipeline.reader import Patience, Reader
from daq_app.acquisition.pipeline.recent import Recent
from daq_app.acquisition.pipeline.recorder import Recorder
from daq_app.acquisition.pipeline.ring import Ring, ring_sessions
from daq_app.acquisition.pipeline.run_recording import Recorded
from daq_app.acquisition.session.wakefulness import Wakefulness
from daq_app.acquisition.session.watchdog import Watchdog
from daq_app.config.planning.plan import TaskPlan
from daq_app.config.rig import Rig
from daq_app.runfile import RunFileError, RunHeader, TestPlan
from daq_app.runfile.folder import JOURNAL_SUFFIX, RUN_SUFFIX, find_journals
from drivers import BackupRecorder, Driver, DriverError, Opened

_T = TypeVar("_T")
_RESULT_S: Final = 120.0
"""How long the end of the process waits for results that are being made."""
_DISK_BEHIND_S: Final = 1.5
"""When the disk is further behind than this, nobody is told to release."""


@dataclass(frozen=True, slots=True)
class SessionSettings:
    """What a session needs to know beside the rig."""

    rig: Rig
    rig_text: str
    plan: TaskPlan
    folder: Path
    make_driver: Callable[[], Driver]
    release_within_s: float = 1800.0
    spare_folder: Path | None = None
    last_resorts: tuple[Path, ...] = ()
    """Where a run goes on when its own folder and the spare one take nothing."""
    truth: dict[str, Any] | None = None
    """What a simulated wall is made from; goes into every run."""
    patience: Patience = field(default_factory=Patience)
    make_results: bool = False
    """Make the result of every test when it has been saved."""
    speed: float = 1.0
    """How much faster than real time the simulated device or the replay runs."""


class Session:
    """Call everything from the main thread; the threads inside talk through queues."""

    def __init__(self, settings: SessionSettings, publisher: Publisher, finaliser: Finaliser) -> None:
        self._settings = settings
        self._publisher = publisher
        self._finaliser = finaliser
        self._saving: list[Future[Finished]] = []
        acquisition, rate_hz = settings.rig.acquisition, settings.plan.rate_hz
        self.ring = Ring(settings.folder, round(acquisition.ring_s * rate_hz), self._ring_header)
        self._spares = tuple(
            place for place in (settings.spare_folder, *settings.last_resorts) if place is not None
        )
        self.recorder = Recorder(
            self._forward,
            self._announce,
            self._hand_over,
            self._spares,
            self.ring,
            Recent(round(min(acquisition.ring_s, KEPT_BEFORE_S) * rate_hz)),
        )
        self.analyst = Analyst(
            settings.rig,
            publisher,
            Surrounding(
                post=self.recorder.inbox.put,
                hurry=self._hurry,
                arm=self._begin,
                keep=self._keep,
                opening=lambda: self._reader is not None and self._reader.opening,
                silent=lambda: self._reader is not None and self._reader.silent,
                disk_safe=self._disk_safe,
                free_bytes=lambda: self.watchdog.free_bytes,
            ),
            release_within_s=settings.release_within_s,
            planned_rate_hz=settings.plan.rate_hz,
        )
        self.watchdog = Watchdog(self.recorder, settings.folder, self._say)
        self._wakefulness = Wakefulness()
        self.results = ResultMaker(self._tell_result)
        self.opened: Opened | None = None
        self.error: DriverError | None = None
        """Why sampling ended, if it ended by a fault."""
        self.recent_events: deque[EventMessage] = deque(maxlen=50)
        """For viewers that come later: what was recovered, which module is wrong, what was lost."""
        self._reader: Reader | None = None

    # -- life ------------------------------------------------------------------------------------

    def start(self) -> None:
        """Start the threads, recover what an earlier session left behind, and begin to sample."""
        self.recorder.start()
        self.ring.start()
        self.results.start()
        self.analyst.start()
        # Listed now: what this session will record is none of them.
        rings = [place for place in ring_sessions(self._settings.folder) if place != self.ring.place]
        folders = [self._settings.folder, *self._spares]
        left = [path for folder in folders if folder.is_dir() for path in find_journals(folder)]
        if left:
            names = ", ".join(path.stem for path in left[:3]) + (" …" if len(left) > 3 else "")
            text = (
                f"An earlier session was cut off: {len(left)} recording(s) ({names}) are being made into "
                "runs now. You may go on; what is in them is told when they are there"
            )
            self._say(EventMessage(kind="recovering", sample=0, text=text, severity="warning"))
        for journal in left:
            job = {"job": "recover", "journal": str(journal)}
            self._finaliser.submit(job, self._tell_recovery)
        for ring in rings:
            job = {"job": "ring", "journal": str(ring), "out": str(self._settings.folder)}
            self._finaliser.submit(job, self._tell_recovery)
        self.preview()

    def close(self) -> None:
        """Stop sampling, close what is open, wait until it is saved, end the threads.

        Journals of earlier sessions that have not been recovered yet wait for the next start.
        """
        if self._reader is not None:
            self._reader.request_stop()
            self._reader.join()
        self.recorder.inbox.put(None)
        self.recorder.join()
        # A wall that is not upright at the end may be falling: the next start looks at what is left.
        self.ring.close(keep=not self.analyst.upright)
        for job in self._saving:
            job.result()
        self.results.close(_RESULT_S)
        self.analyst.inbox.put(None)
        self.analyst.join()
        self._wakefulness.close()

    def tick(self) -> None:
        """Five times a second, on the main thread."""
        if self.recording:
            self._wakefulness.hold()
        else:
            self._wakefulness.allow_sleep()
        renew_reserve()
        self._publisher.send("health", self.watchdog.look(self._reader, self.analyst.overloaded))

    def tell_fault(self, text: str) -> None:
        """Say that something of ours failed, once for each text."""
        if all(event.text != text for event in self.recent_events):
            self._say(
                EventMessage(
                    kind="alarm",
                    sample=self.recorder.status.sample,
                    text=text,
                    severity="error",
                    data={"alarm": "fault"},
                )
            )

    @property
    def state(self) -> State:
        return self.analyst.state

    @property
    def recording(self) -> bool:
        return self.recorder.status.recording

    @property
    def busy(self) -> bool:
        """Whether a run is being recorded or made into its file."""
        return self.recording or self.state is State.SAVING or self._is_saving()

    # -- between the threads ---------------------------------------------------------------------

    def _forward(self, item: Item) -> None:
        """On the recorder's thread, after the journal has the item."""
        match item:
            case Started(opened=opened):
                self.opened = opened
                self._finaliser.warm()
            case SourceEnded(error=error):
                self.opened = None
                self.error = error
        self.analyst.inbox.put(item)

    def _hurry(self, quickly: bool) -> None:
        """On the analyst's thread."""
        if self._reader is not None:
            self._reader.hurry(quickly)

    def _announce(self, event: EventMessage) -> None:
        self.recent_events.append(event)
        self._publisher.send("event", event)

    def _say(self, event: EventMessage) -> None:
        self.recorder.inbox.put(Noted(event))

    def _hand_over(self, recorded: Recorded) -> None:
        """On the recorder's thread, when a journal is closed."""
        self.analyst.inbox.put(Closed(recorded.journal, recorded.end))
        if not self.recording:
            self._stop_backup()
        if recorded.journal is None:
            self._tell_saved(recorded, Finished(False, ""))
            return
        out = recorded.journal.with_suffix(RUN_SUFFIX)
        job = {"job": "finalise", "journal": str(recorded.journal), "out": str(out)}
        self._saving.append(self._finaliser.submit(job, lambda done: self._tell_saved(recorded, done)))

    def _tell_saved(self, recorded: Recorded, finished: Finished) -> None:
        """On the finaliser's thread."""
        ok = finished.ok and recorded.end.outcome != "failed"
        text = finished.text if ok else f"{recorded.end.text}. {finished.text}".removesuffix(". ")
        self._say(
            EventMessage(
                kind="saved" if finished.ok else "unsaved",
                sample=recorded.end.sample,
                text=text,
                severity="info" if ok else "error",
                data={"run": finished.path, "outcome": recorded.end.outcome, "test": recorded.header.test},
            )
        )
        self.analyst.inbox.put(Saved(ok, text, finished.path))
        give_back()
        released = recorded.end.outcome in ("complete", "timeout", "stopped")
        if self._settings.make_results and ok and finished.path and released and recorded.header.kept is None:
            self.results.make(Path(finished.path))

    def _tell_result(self, run: Path, ok: bool, said: str) -> None:
        """On the result maker's thread."""
        text = f"The result of {run.stem.split('_')[0]} is saved" if ok else said
        event = EventMessage(
            kind="result",
            sample=self.recorder.status.sample,
            text=text,
            severity="info" if ok else "warning",
            data={"run": str(run), "ok": float(ok)},
        )
        if text:
            self._say(event)

    def _tell_recovery(self, finished: Finished) -> None:
        """On the finaliser's thread."""
        if not finished.text:
            return
        self._say(
            EventMessage(
                kind="recovered" if finished.ok else "unrecovered",
                sample=0,
                text=f"Left by an earlier session: {finished.text}",
                severity="warning" if finished.ok else "error",
                data={"run": finished.path},
            )
        )
        if self._settings.make_results and finished.ok and finished.path:
            self.results.make(Path(finished.path))

    # -- requests --------------------------------------------------------------------------------

    def preview(self) -> str:
        """Begin to sample, if nothing samples yet."""
        if self._reader is not None and self._reader.is_alive():
            return "Sampling already"
        self.error = None
        settings, inbox = self._settings, self.recorder.inbox
        self._reader = Reader(
            settings.make_driver, settings.plan, inbox.put, settings.patience, settings.speed, self._is_saving
        )
        self._reader.start()
        return "Sampling begins"

    def arm(self, plan: TestPlan, *, overrule: bool = False) -> Future[tuple[str, dict[str, Any]]]:
        """Record from now on as planned, once the orders before are done. Raises `RequestRefused`.

        `overrule`: in spite of a sensor check that says no-go. The future's data has the journal's path.
        """
        check_name(plan.test)
        if self.opened is None:
            raise RequestRefused("Nothing is being sampled. Start the preview first")
        if self.recording and not self.analyst.gives_way:
            raise RequestRefused("A run is being recorded already. Stop or abort it before the next one")
        check_space(self._settings.folder, self._settings.rig, self.opened.rate_hz)
        return self.ask("arm", {"plan": plan, "overrule": overrule})

    def _begin(self, plan: TestPlan, tare: Tare) -> Future[Path]:
        """On the analyst's thread, with the zero that is in force."""
        rate_hz = self._settings.plan.rate_hz
        before = round(self._settings.rig.acquisition.pre_trigger_s * rate_hz)
        specimen = plan.specimen or self._settings.rig.specimen.name
        begin = self._order(plan.test, tare, before, plan.model_copy(update={"specimen": specimen}))
        self.recorder.inbox.put(begin)
        return begin.done

    def _keep(self, release_sample: int, tare: Tare) -> None:
        """On the analyst's thread: record a release that nobody armed."""
        rate_hz = self._settings.plan.rate_hz
        before = round(KEPT_BEFORE_S * rate_hz) + max(0, self.recorder.status.sample - release_sample)
        begin = self._order(UNARMED, tare, before, None)
        kept = {"ring": self.ring.session, "release_sample": release_sample}
        header = begin.header.model_copy(update={"kept": kept, "notes": "Not armed: kept from the ring."})
        self.recorder.inbox.put(replace(begin, header=header, kept=True))

    def _order(self, test: str, tare: Tare, before_samples: int, plan: TestPlan | None) -> Begin:
        settings = self._settings
        if self.opened is None:
            raise RequestRefused("Nothing is being sampled. Start the preview first")
        header = make_header(
            settings.rig,
            settings.rig_text,
            settings.plan,
            self.opened,
            tare,
            test=test,
            notes=plan.notes if plan is not None else "",
            truth=settings.truth,
            test_plan=plan,
        )
        if self._reader is not None:
            self._reader.ask(lambda driver: self._start_backup(driver, header.run_id))
        path = settings.folder / f"{header.run_id}{JOURNAL_SUFFIX}"
        return Begin(path, header, before_samples=before_samples)

    def _ring_header(self, run_id: str) -> RunHeader:
        """On the ring's thread: the header of its next segment."""
        opened, settings = self.opened, self._settings
        if opened is None:
            raise RunFileError("Nothing is being sampled")
        header = make_header(
            settings.rig, settings.rig_text, settings.plan, opened, self.analyst.tare, test=UNARMED
        )
        return header.model_copy(update={"run_id": run_id, "kept": {"ring": self.ring.session}})

    def _is_saving(self) -> bool:
        return not all(run.done() for run in self._saving)

    def _disk_safe(self) -> bool:
        status = self.recorder.status
        behind = status.sample - status.acknowledged_sample
        return status.recording and behind <= _DISK_BEHIND_S * self._settings.plan.rate_hz * max(
            1.0, min(self._settings.speed, 100.0)
        )

    def _start_backup(self, driver: Driver, stem: str) -> None:
        """On the reader's thread: the second recorder, where it is on. It must never cost the first."""
        if not isinstance(driver, BackupRecorder):
            return
        try:
            paths = driver.start_backup(stem)
        except DriverError as error:
            self._say(EventMessage(kind="backup", sample=0, text=str(error), severity="error"))
            return
        if paths:
            text = f"The NI driver records as well: {', '.join(paths)}"
            self._say(EventMessage(kind="backup", sample=self.recorder.status.sample, text=text))

    def _stop_backup(self) -> None:
        def stop(driver: Driver) -> None:
            if isinstance(driver, BackupRecorder):
                driver.stop_backup()

        if self._reader is not None:
            self._reader.ask(stop)

    def ask(self, name: str, arguments: dict[str, Any]) -> Future[tuple[str, dict[str, Any]]]:
        """Hand a request to the analyst, in step with the samples."""
        ask = Ask(name, arguments)
        self.recorder.inbox.put(ask)
        return ask.done

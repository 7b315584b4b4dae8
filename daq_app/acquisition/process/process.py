"""Life of the acquisition process: from its options to its exit code.

0 ended as asked · 2 bad options, rig file or folder · 3 hardware · 130 interrupted.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import os
import secrets
import signal
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from daq_app.acquisition.closing.finaliser import Finaliser
from daq_app.acquisition.closing.freed_memory import share_one_heap
from daq_app.acquisition.messages.items import RequestRefused
from daq_app.acquisition.messages.options import READY, parse, time_factor
from daq_app.acquisition.messages.published import Command, Reply
from daq_app.acquisition.process.hardware import driver_maker, planned_truth
from daq_app.acquisition.viewers.desk import Answer, Desk, DeskError
from daq_app.acquisition.viewers.session_file import SessionFile, remove_session_file, write_session_file
from daq_app.config import ConfigError, Rig, TaskPlan, load_rig, plan_tasks
from daq_app.runfile import FolderLock, RunFileError
from drivers import DriverError

_TICK_S = 0.2
_LAST_TICKS = 2


class Process:
    """The main thread's part: sockets, session, unattended test, signals."""

    def __init__(self, options: argparse.Namespace, rig: Rig, plan: TaskPlan, stack: ExitStack) -> None:
        connection = options.connection or rig.hardware.connection
        make_driver, self._connection = driver_maker(connection, rig, options, stack)
        self._simulated = connection == "simulated"
        # Loaded while a simulated server starts: the analysis takes seconds to load, and so does it.
        from daq_app.acquisition.pipeline.reader import Patience
        from daq_app.acquisition.process.unattended import Unattended
        from daq_app.acquisition.session.requests import answer
        from daq_app.acquisition.session.session import Session, SessionSettings

        self._rig = rig
        self._answer = answer
        self._no_results = bool(options.no_results)
        self._plan_rate_hz = plan.rate_hz
        self._rig_text = options.rig.read_text(encoding="utf-8")
        self._token = os.environ.get("DAQ_APP_TOKEN") or secrets.token_urlsafe(24)
        self._desk = Desk(options.bind, self._handle, self._token, options.keys)
        stack.callback(self._desk.close)
        finaliser = Finaliser()
        finaliser.start()
        stack.callback(finaliser.close)
        self.session = Session(
            SessionSettings(
                rig=rig,
                rig_text=self._rig_text,
                plan=plan,
                folder=options.out,
                make_driver=make_driver,
                release_within_s=options.release_within,
                spare_folder=options.spare,
                last_resorts=(Path(tempfile.gettempdir()) / "rocking-test-recorder",),
                patience=Patience(reconnect_limit_s=options.reconnect_within),
                truth=planned_truth(connection, rig, options),
                speed=time_factor(options.speed),
                make_results=not options.no_results,
            ),
            self._desk.publisher,
            finaliser,
        )
        self._unattended = Unattended(self.session, options.test, options.notes) if options.test else None
        self._interrupted = False
        self._leaving = False
        self._quiet_ticks = 0
        self._folder = options.out

    def run(self) -> int:
        """Serve until told to end; the exit code."""
        for name in ("SIGINT", "SIGTERM", "SIGBREAK"):
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), self._on_signal)
        address = self._desk.addresses.commands
        write_session_file(
            self._folder,
            SessionFile(address=address, token=self._token, pid=os.getpid(), rig=self._rig.name),
        )
        self.session.start()
        _keep_out_of_collection()
        print(f"{READY}{address}", flush=True)
        try:
            self._desk.serve(self._tick, _TICK_S)
        finally:
            self.session.close()
            remove_session_file(self._folder)
        if self._interrupted:
            return 130
        if self._unattended is not None and self._unattended.exit_code:
            with contextlib.suppress(OSError):  # whoever started us may be gone
                print(self._unattended.text, file=sys.stderr, flush=True)
            return self._unattended.exit_code
        return 0

    def _tick(self) -> None:
        try:
            self.session.tick()
        except Exception as error:
            # Whatever is wrong with watching, it must not end what is being watched.
            self.session.tell_fault(
                f"Watching failed ({type(error).__name__}: {error}). Recording goes on; close other programs"
            )
        if self._unattended is not None and not self._interrupted:
            self._unattended.advance()
            self._leaving = self._leaving or self._unattended.exit_code is not None
        if self._interrupted or self._leaving:
            # One tick more than needed, so that viewers still hear how it ended.
            self._quiet_ticks = 0 if self.session.busy else self._quiet_ticks + 1
            if self._quiet_ticks > _LAST_TICKS:
                self._desk.stop()

    def _on_signal(self, number: int, frame: object) -> None:
        """Ctrl-C and the like: stop the test, keep what was recorded, end."""
        del number, frame
        if self._interrupted:
            return
        self._interrupted = True
        if self.session.recording:
            self.session.ask("stop", {})

    def _handle(self, command: Command) -> Answer:
        if command.name == "hello":
            return Reply(ok=True, text="Rocking-test recorder", data=self._about())
        if command.name == "shutdown":
            return self._shutdown(force=bool(command.arguments.get("force", 0)))
        return self._answer(self.session, command)

    def _about(self) -> dict[str, object]:
        """What a viewer needs to know before it listens."""
        opened = self.session.opened
        return {
            "publisher": self._desk.addresses.publisher,
            "rig_name": self._rig.name,
            "rig_text": self._rig_text,
            "channel_ids": list(self._rig.channel_ids),
            "rate_hz": opened.rate_hz if opened else 0.0,
            "planned_rate_hz": self._plan_rate_hz,
            "check": self.session.analyst.check_message.model_dump(mode="json")["check"],
            "tare": self.session.analyst.tare.readings,
            "tare_record": self.session.analyst.tare.record,
            "connection": self._connection() if opened else "",
            "simulated": self._simulated,
            "makes_results": not self._no_results,
            "events": [event.model_dump(mode="json") for event in self.session.recent_events],
            "folder": str(self._folder.resolve()),
            "pid": os.getpid(),
            "state": self.session.analyst.voice.message().model_dump(mode="json"),
        }

    def _shutdown(self, *, force: bool) -> Answer:
        if self.session.recording and not force:
            raise RequestRefused("A run is being recorded. Stop or abort it first")
        if self.session.recording:
            self.session.ask("stop", {})
        self._leaving = True
        return Reply(ok=True, text="The acquisition process ends once everything is saved")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the process with these options; errors are one paragraph on standard error."""
    options = parse(argv)
    share_one_heap()
    try:
        rig = load_rig(options.rig)
        plan = plan_tasks(rig, str(options.rig))
        with ExitStack() as stack:
            stack.enter_context(FolderLock(options.out))
            return Process(options, rig, plan, stack).run()
    except (ConfigError, RunFileError, DeskError) as error:
        print(str(error), file=sys.stderr, flush=True)
        return 2
    except DriverError as error:
        print(str(error), file=sys.stderr, flush=True)
        return 3


def _keep_out_of_collection() -> None:
    """Take what the process is made of out of Python's cyclic collection.

    It lives as long as the process; a collection that looks through it stops every thread meanwhile: the
    samples wait in the device, and r on its way to the screen.
    """
    gc.collect()
    gc.freeze()


def run_and_exit(argv: Sequence[str]) -> None:
    """`main` for whoever starts us as a function in a new process: its code becomes the exit code."""
    raise SystemExit(main(argv))

"""Opens windows: on a rig, on an acquisition that runs, or on a run."""

from __future__ import annotations

import gc
import importlib
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from daq_app.acquisition.viewers.client import AcquisitionClient, AcquisitionUnreachable
from daq_app.acquisition.viewers.curve import ViewerKeys
from daq_app.acquisition.viewers.launcher import AcquisitionProcess
from daq_app.acquisition.viewers.session_file import read_session_file
from daq_app.campaign.plan import load_campaign
from daq_app.config import ConfigError, Problem, load_rig, plan_tasks
from daq_app.monitor.data.link import Link
from daq_app.monitor.data.settings import WindowSettings
from daq_app.monitor.look.theme import THEMES, apply_theme
from daq_app.monitor.pages.start_page import StartWindow
from daq_app.monitor.window.main_window import MainWindow

_SETTLED_MS: Final = 2000
"""By then a window that was opened has drawn its first pictures."""


def application() -> QApplication:
    """The one Qt application of this process."""
    app = QApplication.instance()
    if isinstance(app, QApplication):
        return app
    app = QApplication(sys.argv[:1])
    app.setApplicationName("Rocking-test recorder")
    return app


def reach(rig: Path, out: Path, options: Sequence[str] = ()) -> tuple[str, str, bool]:
    """(address, token, started here) of an acquisition that records into `out`, started if none runs.

    Raises `ConfigError`, `AcquisitionDied`.
    """
    plan_tasks(load_rig(rig), str(rig))  # a bad rig file is told here, in full
    out.mkdir(parents=True, exist_ok=True)
    found = read_session_file(out)
    if found is not None:
        try:
            with AcquisitionClient(found.address, found.token, topics=(), timeout_s=1.0) as client:
                refuse_other_rig(rig, out, client.about)
                return found.address, found.token, False
        except AcquisitionUnreachable:
            pass  # the file was left behind by a process that died
    process = AcquisitionProcess(["--rig", str(rig), "--out", str(out), *options])
    return process.address, process.token, True


def refuse_other_rig(rig: Path, out: Path, about: Mapping[str, Any]) -> None:
    """Raise `ConfigError` unless the acquisition that runs in `out` records the rig of the file `rig`."""
    runs = str(about.get("rig_text", ""))
    if runs == rig.read_text(encoding="utf-8"):
        return
    name, chosen = str(about.get("rig_name", "another rig")), load_rig(rig).name
    wrong = (
        f"{name} is being recorded into {out}, by a file that has been changed since"
        if name == chosen
        else f"{name} is being recorded into {out}, and {chosen} was chosen"
    )
    right = (
        f"Close the window of {name} and let its recorder end, then open it again"
        if name == chosen
        else f"Choose another folder for {chosen}, for instance {out / chosen}: both can run side by side"
    )
    raise ConfigError([Problem(str(rig), "the folder of the runs", wrong, right)])


def campaign_beside(rig: Path) -> Path | None:
    """The campaign file that belongs to a rig file: the first of ``campaigns/*.toml`` beside it."""
    return next(iter(sorted((rig.parent / "campaigns").glob("*.toml"))), None)


def open_window(
    address: str,
    token: str,
    settings: WindowSettings,
    *,
    keys: ViewerKeys | None = None,
    plan: Path | None = None,
    started_here: bool = False,
) -> MainWindow:
    """A window on an acquisition. Raises `AcquisitionUnreachable`."""
    window = MainWindow(Link(address, token, keys), settings, started_here=started_here)
    if plan is not None:
        try:
            window.set_campaign(load_campaign(plan))
        except ConfigError as error:
            window.notices.tell("warning", f"The campaign cannot be followed: {error}")
    keep_out_of_collection()
    QTimer.singleShot(_SETTLED_MS, window, lambda: _load_what_theory_needs(window))
    return window


def _load_what_theory_needs(window: MainWindow) -> None:
    """Load what draws the theory and the first result: the start does not wait for it."""
    window.background.run(
        lambda: importlib.import_module("scipy.special"),
        lambda _module: keep_out_of_collection(),
        lambda error: window.notices.tell("warning", f"The theory cannot be drawn: {error}"),
    )


def keep_out_of_collection() -> None:
    """Take what the process is made of out of Python's cyclic collection.

    It lives as long as the process; looking through its 200,000 objects again and again stops the window
    for 100 to 300 ms each time, more than anything else that it does. Nothing is collected first: what
    the start leaves behind has no cycles.
    """
    gc.freeze()


def run_on_rig(rig: Path | None, out: Path | None, plan: Path | None, options: Sequence[str] = ()) -> int:
    """Open the window on a rig, or let the operator choose one; returns when it is closed.

    Raises `ConfigError`, `AcquisitionDied`, `AcquisitionUnreachable` for a rig given here; for one
    chosen in the window they are shown there.
    """
    app, settings = application(), WindowSettings()
    windows: list[MainWindow] = []

    def start(chosen: Path, folder: Path) -> None:
        address, token, mine = reach(chosen, folder, options)
        settings.add_recent_rig(chosen)
        settings.runs_folder = folder
        window = open_window(
            address, token, settings, plan=plan or campaign_beside(chosen), started_here=mine
        )
        windows.append(window)
        window.show()

    if rig is not None:
        start(rig, out or settings.runs_folder)
    else:
        chooser = StartWindow(settings, out or settings.runs_folder, start)
        apply_theme(app, chooser, THEMES[settings.theme], settings.type_size)
        chooser.show()
    return _execute(app)


def run_on_address(address: str, token: str, keys: ViewerKeys | None, plan: Path | None) -> int:
    """Open a window on a running acquisition; returns when it closes. Raises `AcquisitionUnreachable`."""
    app = application()
    window = open_window(address, token, WindowSettings(), keys=keys, plan=plan)
    window.show()
    return _execute(app)


def run_on_file(run: Path) -> int:
    """Open a window on a run; returns when it is closed."""
    app = application()
    window = MainWindow(None, WindowSettings())
    window.open_run(run)
    window.show()
    return _execute(app)


def _execute(app: QApplication) -> int:
    """Qt's loop, which Ctrl-C in the terminal ends in good order."""
    previous: Callable[..., object] | int | None = signal.signal(
        signal.SIGINT, lambda *_: app.closeAllWindows()
    )
    heartbeat = QTimer()  # lets Python look at signals now and then
    heartbeat.timeout.connect(lambda: None)
    heartbeat.start(200)
    try:
        return int(app.exec())
    finally:
        signal.signal(signal.SIGINT, previous)

"""Window tests: skipped with the names of the system packages where Qt cannot start."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.support.window.stand_in import StandIn, write_run

FOLDER = Path(__file__).parent
try:
    import PySide6.QtWidgets  # noqa: F401

    QT_TROUBLE = ""
except ImportError as error:
    lines = (FOLDER / "debian-packages.txt").read_text(encoding="utf-8").splitlines()
    packages = " ".join(line for line in lines if line and not line.startswith("#"))
    QT_TROUBLE = f"Qt needs the system packages {packages} ({error})"


QT_FREE = frozenset({"session", "minmax_ring", "motion_trace"})
"""Modules of the window that work without Qt."""


class _SkippedModule(pytest.Module):
    def collect(self) -> Any:
        pytest.skip(QT_TROUBLE, allow_module_level=True)


def pytest_pycollect_makemodule(module_path: Path, parent: Any) -> pytest.Module | None:
    """A module that uses Qt is collected as one skip where Qt cannot start."""
    if not QT_TROUBLE:
        return None
    text = module_path.read_text(encoding="utf-8")
    if "qtbot" in text or not set(re.findall(r"daq_app\.monitor\.(\w+)", text)) <= QT_FREE:
        return _SkippedModule.from_parent(parent, path=module_path)
    return None


@pytest.fixture(scope="session")
def rig(configs: Path) -> Any:
    from daq_app.config import load_rig

    return load_rig(configs / "fr1.toml")


@pytest.fixture
def stand_in(rig: Any) -> Any:
    """The messages of a whole simulated test, without an acquisition process."""
    return StandIn(rig)


@pytest.fixture
def settings(tmp_path: Path) -> Any:
    from daq_app.monitor.data.settings import WindowSettings

    return WindowSettings(tmp_path / "window.ini")


class Clock:
    """A clock that a test moves by hand."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def play() -> Callable[..., None]:
    """Feeds a session what the stand-in publishes up to a time, each message at its instant."""
    from daq_app.monitor.data.session import Published

    def feed(session: Any, clock: Clock, stand_in: Any, until_s: float) -> None:
        start = clock.now
        for instant in stand_in.instants(until_s):
            clock.now = start + instant.time_s
            for message, readings in instant.messages:
                session.feed(Published(message, clock.now, readings))

    return feed


@pytest.fixture
def window(qtbot: Any, settings: Any, rig: Any, clock: Clock) -> Any:
    """A window without a link, whose session a test feeds by hand."""
    from daq_app.monitor.window.main_window import MainWindow

    window: Any = MainWindow(None, settings)
    qtbot.addWidget(window)
    window._frame_timer.stop()
    window._slow_timer.stop()
    window.session.clock = window.clock = clock
    window.session.set_rig(rig, 4000.0)
    window.prepare.set_rig(rig)
    window.header.show()
    return window


@pytest.fixture(scope="session")
def run_file(rig: Any, configs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the stand-in's test as a finished file, in a folder of its own."""
    folder = tmp_path_factory.mktemp("runs")
    return write_run(StandIn(rig), configs / "fr1.toml", folder, "FR1-L1-1", 1)

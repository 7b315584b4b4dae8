"""Children of the program: none waits on standard input while it loads, none is ended by a terminal."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from daq_app import guarded
from daq_app.guarded import end_guarded, start_guarded

_CHILD = (
    "import os, stat, sys\n"
    "print('pipe' if stat.S_ISFIFO(os.fstat(0).st_mode) else 'null', sys.stdout.encoding, flush=True)\n"
    "import threading\n"
    "threading.Event().wait()\n"
)


@pytest.fixture
def child(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> subprocess.Popen[str]:
    (tmp_path / "looks_at_its_input.py").write_text(_CHILD, encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("PYTHONIOENCODING", "cp1252")
    return start_guarded("looks_at_its_input", [])


def test_a_library_that_looks_at_standard_input_while_it_loads_meets_no_waiting_thread(
    child: subprocess.Popen[str],
) -> None:
    assert child.stdout is not None
    try:
        assert child.stdout.readline().split() == ["null", "utf-8"]
        assert child.poll() is None
    finally:
        end_guarded(child)


def test_a_child_ends_by_itself_when_its_parent_lets_go(child: subprocess.Popen[str]) -> None:
    assert child.stdout is not None and child.stdin is not None
    child.stdout.readline()
    child.stdin.close()
    assert child.wait(60.0) == 0
    child.stdout.close()


def test_on_windows_a_child_has_a_console_of_its_own_that_is_not_shown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    windows = SimpleNamespace(CREATE_NEW_PROCESS_GROUP=0x200, CREATE_NO_WINDOW=0x08000000)
    monkeypatch.setattr(guarded, "subprocess", windows)
    monkeypatch.setattr(sys, "platform", "win32")
    assert guarded.apart() == {"creationflags": 0x08000200}


def test_a_window_without_console_starts_children_that_have_streams(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("python.exe", "pythonw.exe"):
        (tmp_path / name).touch()
    monkeypatch.setattr(sys, "executable", str(tmp_path / "pythonw.exe"))
    assert guarded.program() == str(tmp_path / "python.exe")

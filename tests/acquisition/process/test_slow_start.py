"""A slow machine is waited for, a child that has hung is not."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest

from daq_app import waiting
from daq_app.waiting import WorkWatch, wait_for_start

_BUSY = "while True: pass"
_IDLE = "import threading; print('idle', flush=True); threading.Event().wait()"


@pytest.fixture
def start(monkeypatch: pytest.MonkeyPatch) -> Iterator[object]:
    monkeypatch.setattr(waiting, "LOOK_EVERY_S", 0.02)
    monkeypatch.setattr(waiting, "_SAY_EVERY_S", 0.02)
    children: list[subprocess.Popen[bytes]] = []

    def begin(code: str) -> subprocess.Popen[bytes]:
        children.append(subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE))
        return children[-1]

    yield begin
    for child in children:
        child.kill()
        child.communicate()


def test_a_child_that_works_is_waited_for_and_said(start) -> None:
    ready, said = threading.Event(), []

    def say(text: str) -> None:
        said.append(text)
        if len(said) == 5:
            ready.set()

    wait_for_start(ready, start(_BUSY).pid, say)
    assert ready.is_set()
    assert all(line.startswith("Still starting after") for line in said)


def test_a_child_that_does_nothing_is_given_up(start, monkeypatch: pytest.MonkeyPatch) -> None:
    child = start(_IDLE)
    child.stdout.readline()
    watch = WorkWatch(child.pid, idle_limit_s=0.1)
    given_up = threading.Event()
    while watch.works():
        given_up.wait(0.02)
    assert child.poll() is None, "whoever waits decides what becomes of it"


def test_the_work_of_a_grandchild_counts(start) -> None:
    child = start(
        f"import subprocess, sys; p = subprocess.Popen([sys.executable, '-c', {_BUSY!r}]); "
        "print('started', flush=True)\ntry: sys.stdin.read(); p.wait()\nfinally: p.kill()"
    )
    child.stdout.readline()
    watch, tick = WorkWatch(child.pid, idle_limit_s=60.0), threading.Event()
    while watch.worked_s < 0.05:
        tick.wait(0.02)
    assert watch.works()
    for grandchild in waiting.psutil.Process(child.pid).children():
        grandchild.kill()

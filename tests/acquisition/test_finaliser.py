"""Old files in the folder never stand in the way of a new run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from daq_app.acquisition.closing import finaliser as closing
from daq_app.acquisition.closing.finaliser import Finaliser, Finished
from daq_app.guarded import end_guarded, start_guarded
from daq_app.runfile import JournalWriter, RunHeader, open_run
from tests.support.recorder.processes import makers_of_runs


@pytest.fixture
def finaliser(monkeypatch: pytest.MonkeyPatch) -> Iterator[Finaliser]:
    monkeypatch.setattr(closing, "_CLOSING_S", 0.1)
    made = Finaliser()
    made.start()
    yield made
    made.close()


def _journal(path: Path) -> Path:
    header = RunHeader(run_id=path.stem, channel_ids=("a",), reading_units=("V",), rate_hz=100.0)
    with JournalWriter(path, header) as writer:
        writer.append_block(0, np.ones((1, 50)))
    return path


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs something that a reader waits at for ever")
def test_a_journal_that_hangs_its_worker_delays_no_new_run(finaliser: Finaliser, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "old.journal")
    stuck = finaliser.submit({"job": "recover", "journal": str(tmp_path / "old.journal")})
    new = _journal(tmp_path / "new.journal")
    saved = finaliser.submit({"job": "finalise", "journal": str(new), "out": str(tmp_path / "new.h5")})
    assert saved.result(120.0).ok
    with open_run(tmp_path / "new.h5") as run:
        assert run.n_samples == 50
    assert not stuck.done()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs something that a reader waits at for ever")
def test_a_worker_that_does_not_end_is_given_up_and_the_next_journal_is_recovered(
    finaliser: Finaliser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(closing, "_time_limit_s", lambda job: 1.0 if "old" in job["journal"] else 120.0)
    os.mkfifo(tmp_path / "old.journal")
    healthy = _journal(tmp_path / "healthy.journal")
    stuck = finaliser.submit({"job": "recover", "journal": str(tmp_path / "old.journal")})
    recovered = finaliser.submit({"job": "recover", "journal": str(healthy)})
    answer = stuck.result(120.0)
    assert not answer.ok and "is untouched" in answer.text
    assert recovered.result(120.0).ok and (tmp_path / "healthy.h5").exists()


def test_a_worker_loads_before_its_first_job(finaliser: Finaliser) -> None:
    others = makers_of_runs(psutil.Process())
    finaliser.warm()
    waiting = threading.Event()
    while len(makers_of_runs(psutil.Process())) == len(others):
        waiting.wait(0.02)


def test_a_worker_that_cannot_be_started_early_is_started_for_its_job(
    finaliser: Finaliser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tries: list[str] = []

    def start(module: str, *arguments: Any, **options: Any) -> subprocess.Popen[str]:
        tries.append(module)
        if len(tries) == 1:
            raise OSError("no process to be had")
        return start_guarded(module, *arguments, **options)

    monkeypatch.setattr(closing, "start_guarded", start)
    finaliser.warm()
    journal = _journal(tmp_path / "a.journal")
    saved = finaliser.submit({"job": "finalise", "journal": str(journal), "out": f"{tmp_path}/a.h5"})
    assert saved.result(120.0).ok
    assert len(tries) == 2


@pytest.mark.skipif(sys.platform == "win32", reason="kill -9")
def test_a_killed_worker_has_a_successor(finaliser: Finaliser, tmp_path: Path) -> None:
    job = {"job": "finalise", "journal": "", "out": ""}
    first = finaliser.submit(
        job | {"journal": str(_journal(tmp_path / "a.journal")), "out": f"{tmp_path}/a.h5"}
    )
    assert first.result(120.0).ok
    for child in makers_of_runs(psutil.Process()):
        child.send_signal(signal.SIGKILL)
    second = finaliser.submit(
        job | {"journal": str(_journal(tmp_path / "b.journal")), "out": f"{tmp_path}/b.h5"}
    )
    assert second.result(120.0).ok


def test_an_answer_is_told_once_there_is_memory(finaliser: Finaliser, tmp_path: Path) -> None:
    told: list[str] = []

    def tell(finished: Finished) -> None:
        told.append(finished.path)
        if len(told) < 3:
            raise MemoryError

    journal = _journal(tmp_path / "a.journal")
    job = {"job": "finalise", "journal": str(journal), "out": str(tmp_path / "a.h5")}
    assert finaliser.submit(job, tell).result(120.0).ok
    finaliser.close()
    assert told == [str(tmp_path / "a.h5")] * 3


def test_a_worker_that_cannot_even_be_ended_for_want_of_memory_is_tried_again(
    finaliser: Finaliser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refusals = iter([MemoryError(), MemoryError()])

    def end(process: subprocess.Popen[str], grace_s: float = 2.0) -> None:
        for refusal in refusals:
            raise refusal
        end_guarded(process, grace_s)

    def save(name: str) -> Future[Finished]:
        journal = _journal(tmp_path / f"{name}.journal")
        return finaliser.submit({"job": "finalise", "journal": str(journal), "out": f"{tmp_path}/{name}.h5"})

    assert save("a").result(120.0).ok
    monkeypatch.setattr(closing, "end_guarded", end)
    monkeypatch.setattr(closing, "_AGAIN_AFTER_S", 0.0)
    for child in makers_of_runs(psutil.Process()):
        child.kill()
        child.wait()
    assert save("b").result(120.0).ok

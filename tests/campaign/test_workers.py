"""Jobs in many processes: order, progress, and errors that arrive as they were raised."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from daq_app.runfile.errors import JournalDiskFull
from daq_app.workers import run_all


def _negative(number: int) -> tuple[int, str]:
    return -number, os.environ["OMP_NUM_THREADS"]


def _full(number: int) -> int:
    if number == 1:
        raise JournalDiskFull("no space left", advice="Free some.", safe_sample=41)
    return number


def test_answers_come_in_order_and_workers_have_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    told: list[tuple[int, int]] = []
    answers = run_all(_negative, [3, 1, 2], 2, lambda done, job: told.append((done, job)))
    assert answers == [(-3, "1"), (-1, "1"), (-2, "1")]
    assert [done for done, _ in told] == [1, 2, 3]
    assert sorted(job for _, job in told) == [1, 2, 3]
    assert "OMP_NUM_THREADS" not in os.environ


def test_workers_have_one_thread_also_where_another_part_started_the_fork_server(tmp_path: Path) -> None:
    script = tmp_path / "program.py"
    script.write_text(
        """
import os
from daq_app.workers import run_all, worker_context

def threads(number):
    return os.environ.get("OMP_NUM_THREADS")

if __name__ == "__main__":
    first = worker_context().Process(target=print)
    first.start()
    first.join()
    print(run_all(threads, [0], 1))
""",
        encoding="utf-8",
    )
    environment = {name: value for name, value in os.environ.items() if name != "OMP_NUM_THREADS"}
    said = subprocess.run(
        [sys.executable, str(script)], env=environment, capture_output=True, text=True, check=True
    )
    assert said.stdout.split() == ["['1']"], said.stderr


def test_an_error_of_a_worker_arrives_whole() -> None:
    with pytest.raises(JournalDiskFull) as caught:
        run_all(_full, [0, 1, 2], 1)
    assert (caught.value.advice, caught.value.safe_sample) == ("Free some.", 41)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_nothing_to_do_starts_nothing() -> None:
    assert run_all(_negative, []) == []

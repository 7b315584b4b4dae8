"""Limits of the kernel and other programs: no memory, no file handles, processor and disk taken.

Each test's limit is the kernel's own and is set on the recorder alone.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from daq_app.acquisition.messages.published import State
from daq_app.config import Rig
from daq_app.runfile import recover
from tests.support.recorder.fault_bench import LIMIT_S, Acquisition, Row, another_process, look_at
from tests.support.recorder.processes import makers_of_runs

if sys.platform != "linux":
    pytest.skip("needs Linux's prlimit", allow_module_level=True)
import resource

pytestmark = pytest.mark.heavy

Limit = Callable[[int, int], None]
_TOO_LITTLE_BYTES = 32 * 2**20
"""Address space in which no interpreter starts, and less than a recorder has already."""


@pytest.fixture
def limit(shared: Acquisition) -> Iterator[Limit]:
    """Sets a soft limit of the kernel on the recorder; lifted again by 0 and at the end."""
    pid = shared.process.pid
    assert pid is not None
    before: dict[int, tuple[int, int]] = {}

    def put(which: int, soft: int) -> None:
        before.setdefault(which, resource.prlimit(pid, which))
        resource.prlimit(pid, which, (soft, before[which][1]) if soft else before[which])

    yield put
    with contextlib.suppress(ProcessLookupError):
        for which, limits in before.items():
            resource.prlimit(pid, which, limits)


def kill_the_maker_of_runs(shared: Acquisition) -> None:
    """The process that is kept warm to make run files: the next one has to be started."""
    for maker in makers_of_runs(psutil.Process(shared.process.pid)):
        maker.kill()


@pytest.mark.parametrize(
    ("which", "soft", "name"),
    [
        (resource.RLIMIT_AS, _TOO_LITTLE_BYTES, "no memory for anything new (RLIMIT_AS)"),
        (resource.RLIMIT_NOFILE, 16, "no file handle left (RLIMIT_NOFILE)"),
    ],
    ids=["memory", "file handles"],
)
def test_a_run_is_kept_where_the_system_refuses(
    shared: Acquisition, rig: Rig, row: Row, limit: Limit, which: int, soft: int, name: str
) -> None:
    journal = shared.arm()
    shared.strike()
    limit(which, soft)
    kill_the_maker_of_runs(shared)
    shared.record(8000)
    refused = shared.stop()
    limit(which, 0)
    assert refused.state is State.FAILED and "daq-app recover" in refused.text, refused.text
    assert journal.exists()
    told = shared.told("daq-app recover")
    again = shared.arm("FR1-L3-2")
    assert look_at(shared.stop().run_path, rig).lost == 0, "the next test is recorded and saved"
    assert again.stem != journal.stem
    (found,) = recover(journal)
    assert found.run is not None, found
    facts = look_at(found.run, rig)
    assert facts.lost == 0, facts.account
    row(name, told, facts)


def keep_busy() -> None:
    """A program that never waits."""
    while True:
        pass


def write_for_ever(folder: str) -> None:
    """A program that keeps a disk busy: 32 MB and a flush, again and again."""
    junk = os.urandom(2**20)
    while True:
        with (Path(folder) / "other-program.bin").open("wb") as file:
            for _ in range(32):
                file.write(junk)
            file.flush()
            os.fsync(file.fileno())


def test_programs_that_take_processor_and_disk(shared: Acquisition, rig: Rig, row: Row) -> None:
    shared.arm()
    shared.strike()
    hogs: list[Any] = [another_process(keep_busy) for _ in range(2 * (os.cpu_count() or 1))]
    hogs.append(another_process(write_for_ever, str(shared.out)))
    try:
        shared.record(24_000)
        saved = shared.stop()
    finally:
        for hog in hogs:
            hog.kill()
            hog.join()
    facts = look_at(saved.run_path, rig)
    assert facts.lost == 0, facts.account
    row("twice as many busy programs as cores, one more on the disk", None, facts, "nothing was lost")


def test_a_folder_that_takes_no_file_before_arming(shared: Acquisition, rig: Rig, row: Row) -> None:
    shared.arm()
    shared.stop()
    shared.strike()
    # What is told of the clock shows that the folder, too, is read-only by now.
    shared.sabotage(read_only=str(shared.out), clock_s=3600.0)
    shared.told("This computer's clock was set forward")
    refused = shared.client.request("arm", timeout_s=LIMIT_S, test="FR1-L3-3")
    assert not refused.ok and str(shared.out) in refused.text, refused.text
    shared.sabotage()
    shared.arm("FR1-L3-3")
    facts = look_at(shared.stop().run_path, rig)
    assert facts.lost == 0, facts.account
    row("folder that takes no file before arming", None, facts, refused.text)

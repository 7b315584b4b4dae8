"""The recorder when the disk fails it: real journals, with the system calls under them made to fail."""

from __future__ import annotations

import errno
import os
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq_app.acquisition.messages.items import Arrived, Begin, End, Item, Lost, Noted, RequestRefused
from daq_app.acquisition.messages.published import EventMessage
from daq_app.acquisition.pipeline.recent import Recent
from daq_app.acquisition.pipeline.recorder import Recorder
from daq_app.acquisition.pipeline.ring import Ring
from daq_app.acquisition.pipeline.run_recording import Recorded
from daq_app.acquisition.pipeline.unwritten import Unwritten
from daq_app.runfile import JournalWriter, RunHeader, read_journal
from drivers import Block

N_CHANNELS = 4


class Disk:
    """Stands between the journal and the system; fails on command."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.full = False
        self.broken: bool | Path = False
        """All files, or that one."""
        self.flush_breaks: Path | None = None
        self.flush_takes = threading.Event()
        self.flush_takes.set()
        write, fsync = os.write, os.fsync

        def failing_write(fd: int, data: Any) -> int:
            if self.full:
                raise OSError(errno.ENOSPC, "No space left on device")
            if self.broken is True or (self.broken and _is(fd, self.broken)):
                raise OSError(errno.EIO, "Input/output error")
            return write(fd, data)

        def slow_fsync(fd: int) -> None:
            if not self.flush_takes.wait(10.0):
                raise OSError(errno.EIO, "Input/output error")
            if self.flush_breaks is not None and _is(fd, self.flush_breaks):
                raise OSError(errno.EIO, "Input/output error")
            fsync(fd)

        monkeypatch.setattr("os.write", failing_write)
        for name in ("fsync", "fdatasync"):
            if hasattr(os, name):
                monkeypatch.setattr(f"os.{name}", slow_fsync)


def _is(fd: int, path: Path | bool) -> bool:
    return isinstance(path, Path) and path.exists() and os.path.samestat(os.fstat(fd), path.stat())


class Bench:
    """A recorder with everything it says and hands over."""

    def __init__(
        self,
        folder: Path,
        spare: Path | None = None,
        ring: Ring | None = None,
        recent: Recent | None = None,
    ) -> None:
        self.folder = folder
        self.forwarded: list[Item] = []
        self.said: list[EventMessage] = []
        self.handed: list[Recorded] = []
        self.changed = threading.Condition()
        self.recorder = Recorder(
            self._note(self.forwarded),
            self._note(self.said),
            self._note(self.handed),
            [spare] if spare is not None else [],
            ring,
            recent,
        )
        if ring is not None:
            ring.start()
        self.recorder.start()

    def _note(self, where: list[Any]) -> Callable[[Any], None]:
        def note(what: Any) -> None:
            with self.changed:
                where.append(what)
                self.changed.notify_all()

        return note

    def until(self, right: Callable[[], bool], timeout_s: float = 60.0) -> None:
        deadline = time.monotonic() + timeout_s
        with self.changed:
            while not right():
                assert time.monotonic() < deadline, (self.said, self.recorder.status)
                self.changed.wait(0.05)

    def begin(self, name: str = "run", before_samples: int = 0, kept: bool = False) -> Path:
        done: Future[Path] = Future()
        path = self.folder / f"{name}.journal"
        self.recorder.inbox.put(Begin(path, header(name), done, before_samples, kept))
        return done.result(10.0)

    def blocks(self, first: int, count: int) -> None:
        for n in range(first, first + count):
            self.recorder.inbox.put(Arrived(Block(n * 100, readings(n * 100), 0, 0), time.perf_counter()))

    def end(self) -> Recorded:
        self.recorder.inbox.put(End("complete", 0, "done"))
        self.until(lambda: bool(self.handed))
        return self.handed[-1]

    def heard(self, severity: str, words: str) -> bool:
        return any(e.severity == severity and words in e.text for e in self.said)


def header(name: str) -> RunHeader:
    return RunHeader(
        run_id=name,
        channel_ids=tuple(f"C{n}" for n in range(N_CHANNELS)),
        reading_units=("V",) * N_CHANNELS,
        rate_hz=4000.0,
    )


def readings(first: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.arange(first, first + 100.0) + 1000.0 * np.arange(N_CHANNELS)[:, None]


def contents(journal: Path) -> dict[int, float]:
    """Sample → reading of the first channel."""
    found: dict[int, float] = {}
    with read_journal(journal) as opened:
        for first, window in opened.windows(1000):
            for offset, value in enumerate(window[0]):
                if not np.isnan(value):
                    found[first + offset] = value
    return found


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    return Disk(monkeypatch)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Callable[..., Bench]]:
    made: list[Bench] = []

    def make(spare: Path | None = None, **parts: Any) -> Bench:
        made.append(Bench(tmp_path, spare, **parts))
        return made[-1]

    yield make
    for one in made:
        one.recorder.inbox.put(None)
        one.recorder.join()


def test_blocks_are_in_the_journal_before_anybody_else_sees_them(bench: Callable[..., Bench]) -> None:
    lab = bench()
    journal = lab.begin()
    sizes: list[int] = []
    forward = lab.recorder._forward

    def spy(item: Item) -> None:
        if isinstance(item, Arrived):
            sizes.append(journal.stat().st_size)
        forward(item)

    lab.recorder._forward = spy
    lab.blocks(0, 5)
    lab.until(lambda: len(sizes) == 5)
    grown = np.diff([0, *sizes])
    assert (grown[1:] > 100 * N_CHANNELS * 8).all()


def test_blocks_right_behind_the_end_of_a_run_do_not_begin_the_next_one(
    bench: Callable[..., Bench], disk: Disk
) -> None:
    """A reader that catches up puts blocks behind the end before it is written; between runs they pass by."""
    lab = bench()
    first = lab.begin()
    disk.full = True
    lab.blocks(0, 5)
    lab.until(lambda: lab.heard("error", "full"))
    lab.recorder.inbox.put(End("complete", 500, "done"))
    lab.blocks(5, 3)
    lab.until(lambda: sum(isinstance(item, Arrived) for item in lab.forwarded) == 8)
    disk.full = False
    lab.until(lambda: bool(lab.handed))
    lab.blocks(8, 4)
    lab.until(lambda: sum(isinstance(item, Arrived) for item in lab.forwarded) == 12)
    assert lab.recorder.status.waiting_bytes == 0
    second = lab.begin("next")
    lab.blocks(12, 5)
    lab.end()
    lab.until(lambda: len(lab.handed) == 2)
    assert sorted(contents(first)) == list(range(500))
    assert sorted(contents(second)) == list(range(1200, 1700))
    with read_journal(second) as opened:
        assert not opened.gaps


def test_a_full_disk_costs_nothing_once_there_is_room_again(bench: Callable[..., Bench], disk: Disk) -> None:
    lab = bench()
    journal = lab.begin()
    lab.blocks(0, 5)
    lab.until(lambda: lab.recorder.status.acknowledged_sample == 500)
    disk.full = True
    lab.blocks(5, 20)
    lab.until(lambda: lab.heard("error", "full"))
    lab.until(lambda: lab.recorder.status.waiting_bytes == 20 * 100 * N_CHANNELS * 8)
    assert lab.recorder.status.acknowledged_sample == 500
    disk.full = False
    lab.until(lambda: lab.recorder.status.acknowledged_sample == 2500)
    lab.until(lambda: lab.heard("info", "takes data again"))
    assert lab.end().end.outcome == "complete"
    assert contents(journal) == {n: float(n) for n in range(2500)}


def test_a_slow_disk_is_told_and_costs_nothing(bench: Callable[..., Bench], disk: Disk) -> None:
    lab = bench()
    journal = lab.begin()
    disk.flush_takes.clear()
    lab.blocks(0, 10)
    lab.until(lambda: lab.heard("error", "not confirmed"))
    assert lab.recorder.status.acknowledged_sample == 0
    disk.flush_takes.set()
    lab.until(lambda: lab.recorder.status.acknowledged_sample == 1000)
    assert lab.recorder.latency.worst_ms > 300.0
    lab.end()
    assert contents(journal) == {n: float(n) for n in range(1000)}


def test_a_broken_disk_moves_the_recording_to_the_spare_folder(
    bench: Callable[..., Bench], disk: Disk, tmp_path: Path
) -> None:
    lab = bench(tmp_path / "spare")
    journal = lab.begin()
    lab.blocks(0, 5)
    lab.until(lambda: lab.recorder.status.acknowledged_sample == 500)
    disk.broken = journal
    lab.blocks(5, 10)
    lab.until(lambda: lab.heard("error", "Recording goes on in"))
    lab.recorder.inbox.put(Noted(EventMessage(kind="marker", sample=1500, text="after")))
    recorded = lab.end()
    assert recorded.journal == tmp_path / "spare" / journal.name
    assert contents(recorded.journal) == {n: float(n) for n in range(1500)}, "one run, with all of it"
    assert [path.name for path in tmp_path.glob("run.*")] == ["run.journal-moved"]
    with read_journal(recorded.journal) as opened:
        assert not opened.damage and opened.gaps == ()
        assert [event.kind for event in opened.events].count("marker") == 1


def test_what_was_not_acknowledged_is_written_once_more_when_the_disk_breaks(
    bench: Callable[..., Bench], disk: Disk, tmp_path: Path
) -> None:
    """Gaps and events in the unsafe part: nothing twice, nothing missing, and the counts stay right."""
    lab = bench(tmp_path / "spare")
    journal = lab.begin()
    lab.blocks(0, 5)
    lab.until(lambda: lab.recorder.status.acknowledged_sample == 500)
    disk.flush_takes.clear()
    lab.recorder.inbox.put(Lost(500, 100, "overwritten"))
    lab.recorder.inbox.put(Noted(EventMessage(kind="marker", sample=550, text="between")))
    lab.blocks(6, 3)
    lab.until(lambda: lab.heard("error", "not confirmed"))
    disk.flush_breaks = journal
    disk.flush_takes.set()
    lab.until(lambda: lab.heard("error", "Recording goes on in"))
    lab.blocks(9, 3)
    lab.until(lambda: lab.recorder.status.acknowledged_sample == 1200)
    assert (lab.recorder.status.gaps, lab.recorder.status.lost_samples) == (1, 100)
    recorded = lab.end()
    expected = {n: float(n) for n in range(1200) if not 500 <= n < 600}
    assert contents(recorded.journal) == expected
    with read_journal(recorded.journal) as opened:
        assert [(gap.first_sample, gap.n_samples) for gap in opened.gaps] == [(500, 100)]
        assert [event.kind for event in opened.events].count("marker") == 1
        assert not opened.damage


def test_an_old_file_that_cannot_be_read_any_more_is_continued_in_a_run_of_its_own(
    bench: Callable[..., Bench], disk: Disk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lab = bench(tmp_path / "spare")
    journal = lab.begin()
    lab.blocks(0, 5)
    lab.until(lambda: lab.recorder.status.acknowledged_sample == 500)

    def unreadable(fd: int, size: int) -> bytes:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr("os.read", unreadable)
    disk.broken = journal
    lab.blocks(5, 10)
    lab.until(lambda: lab.heard("error", "Recording goes on in"))
    recorded = lab.end()
    monkeypatch.undo()
    assert "Continues run run after" in recorded.header.notes
    found = {**contents(journal), **contents(recorded.journal)}
    assert found == {n: float(n) for n in range(1500)}


@pytest.mark.parametrize("error", [MemoryError(), RuntimeError("a fault of ours")])
def test_the_recorder_outlives_errors_that_no_disk_has(
    bench: Callable[..., Bench], error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    lab = bench()
    journal = lab.begin()
    lab.blocks(0, 5)
    lab.until(lambda: lab.recorder.status.acknowledged_sample == 500)
    real = JournalWriter.append_block
    broken = threading.Event()
    broken.set()

    def failing(writer: JournalWriter, first: int, block: Any) -> None:
        if broken.is_set():
            raise error
        real(writer, first, block)

    monkeypatch.setattr(JournalWriter, "append_block", failing)
    lab.blocks(5, 5)
    lab.until(lambda: lab.heard("error", "memory" if isinstance(error, MemoryError) else "a fault of ours"))
    broken.clear()
    lab.until(lambda: lab.recorder.status.acknowledged_sample == 1000)
    lab.end()
    assert contents(journal) == {n: float(n) for n in range(1000)}


@pytest.mark.skipif(os.name == "nt", reason="Windows does not delete a file that is open")
def test_a_folder_deleted_under_the_run_costs_nothing(bench: Callable[..., Bench], tmp_path: Path) -> None:
    lab = bench(tmp_path / "spare")
    lab.folder = tmp_path / "runs"
    lab.folder.mkdir()
    journal = lab.begin()
    lab.blocks(0, 5)
    lab.until(lambda: lab.recorder.status.acknowledged_sample == 500)
    shutil.rmtree(lab.folder)
    following = 5
    while not lab.heard("error", "was deleted or moved"):
        lab.blocks(following, 1)
        following += 1
        lab.until(lambda: lab.recorder.status.sample == following * 100)  # noqa: B023
    recorded = lab.end()
    assert recorded.journal == tmp_path / "spare" / journal.name
    assert contents(recorded.journal) == {n: float(n) for n in range(following * 100)}


def test_disks_that_all_fail_for_a_moment_cost_nothing(
    bench: Callable[..., Bench], disk: Disk, tmp_path: Path
) -> None:
    """The run waits in memory, its file held open, until one of the places takes it again."""
    lab = bench(tmp_path / "spare")
    lab.begin()
    lab.blocks(0, 5)
    lab.until(lambda: lab.recorder.status.acknowledged_sample == 500)
    disk.broken = True
    lab.blocks(5, 3)
    lab.until(lambda: lab.heard("error", "No other place takes the run"))
    lab.blocks(8, 4)
    lab.until(lambda: lab.recorder.status.sample == 1200)
    disk.broken = False
    recorded = lab.end()
    assert recorded.end.outcome == "complete" and recorded.journal is not None
    assert contents(recorded.journal) == {n: float(n) for n in range(1200)}
    assert lab.recorder.status.lost_samples == 0


@pytest.mark.skipif(os.name == "nt", reason="Windows does not delete a file that is open")
def test_a_folder_deleted_while_no_other_place_takes_the_run_costs_nothing(
    bench: Callable[..., Bench], disk: Disk, tmp_path: Path
) -> None:
    lab = bench()
    lab.folder = tmp_path / "runs"
    lab.folder.mkdir()
    lab.begin()
    lab.blocks(0, 5)
    lab.until(lambda: lab.recorder.status.acknowledged_sample == 500)
    shutil.rmtree(lab.folder)
    (tmp_path / "runs").write_text("in the way")  # the folder cannot be made again either
    following = 5
    while not lab.heard("error", "No other place"):
        lab.blocks(following, 1)
        following += 1
        lab.until(lambda: lab.recorder.status.sample == following * 100)  # noqa: B023
    (tmp_path / "runs").unlink()
    recorded = lab.end()
    assert recorded.journal is not None
    assert contents(recorded.journal) == {n: float(n) for n in range(following * 100)}


def test_when_no_disk_ever_takes_it_what_was_lost_is_counted_truly(
    bench: Callable[..., Bench], disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("daq_app.acquisition.pipeline.recorder._SHUT_S", 0.3)
    lab = bench()
    journal = lab.begin()
    lab.blocks(0, 5)
    lab.until(lambda: lab.recorder.status.acknowledged_sample == 500)
    disk.broken = True
    lab.blocks(5, 3)
    lab.recorder.inbox.put(None)
    lab.until(lambda: bool(lab.handed))
    assert lab.handed[0].end.outcome == "failed"
    assert "300 of 800 samples could not be kept" in lab.handed[0].end.text
    assert f"The first 500 are in {journal}" in lab.handed[0].end.text
    assert lab.recorder.status.lost_samples == 300
    disk.broken = False
    assert contents(journal) == {n: float(n) for n in range(500)}


@pytest.mark.skipif(os.name == "nt", reason="Windows does not delete a file that is open")
def test_of_a_run_whose_file_is_gone_for_good_nothing_is_promised(
    bench: Callable[..., Bench], disk: Disk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("daq_app.acquisition.pipeline.recorder._SHUT_S", 0.3)
    lab = bench()
    lab.folder = tmp_path / "runs"
    lab.folder.mkdir()
    lab.begin()
    lab.blocks(0, 5)
    lab.until(lambda: lab.recorder.status.acknowledged_sample == 500)
    shutil.rmtree(lab.folder)
    disk.broken = True
    lab.blocks(5, 3)
    lab.recorder.inbox.put(None)
    lab.until(lambda: bool(lab.handed))
    assert lab.handed[0].journal is None
    assert "800 of 800 samples could not be kept. No file of it is left" in lab.handed[0].end.text


def test_memory_that_is_full_makes_a_gap_that_is_counted(
    bench: Callable[..., Bench], disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    limit = 4 * 100 * N_CHANNELS * 8
    monkeypatch.setattr(
        "daq_app.acquisition.pipeline.run_recording.Unwritten", partial(Unwritten, limit_bytes=limit)
    )
    lab = bench()
    lab.begin()
    lab.blocks(0, 5)
    lab.until(lambda: lab.recorder.status.acknowledged_sample == 500)
    disk.broken = True
    lab.blocks(5, 10)
    lab.until(lambda: lab.heard("error", "Samples are being lost"))
    lab.until(lambda: lab.recorder.status.sample == 1500)
    disk.broken = False
    lab.until(lambda: lab.heard("info", "500 samples were lost meanwhile"))
    recorded = lab.end()
    assert recorded.journal is not None
    assert sorted(contents(recorded.journal)) == list(range(1000))
    with read_journal(recorded.journal) as opened:
        assert sum(gap.n_samples for gap in opened.gaps) == 500
        assert opened.gaps[0].first_sample == 1000
    assert lab.recorder.status.lost_samples == 500


def test_a_run_begins_with_what_was_in_memory_before_its_order(bench: Callable[..., Bench]) -> None:
    lab = bench(recent=Recent(1000))
    lab.blocks(0, 30)
    lab.until(lambda: lab.recorder.status.sample == 3000)
    journal = lab.begin(before_samples=450)
    lab.blocks(30, 5)
    lab.end()
    assert sorted(contents(journal)) == list(range(2500, 3500)), "whole blocks"


def test_a_release_that_nobody_armed_waits_in_memory_for_a_disk(
    bench: Callable[..., Bench], disk: Disk
) -> None:
    lab = bench(recent=Recent(1000))
    disk.full = True
    lab.blocks(0, 5)
    lab.until(lambda: lab.recorder.status.sample == 500)
    lab.begin("unarmed", before_samples=1000, kept=True)
    lab.blocks(5, 5)
    lab.until(lambda: lab.recorder.status.sample == 1000)
    disk.full = False
    recorded = lab.end()
    assert recorded.journal is not None and recorded.end.outcome == "complete"
    assert contents(recorded.journal) == {n: float(n) for n in range(1000)}


def test_the_ring_holds_the_last_minutes_and_no_more(bench: Callable[..., Bench], tmp_path: Path) -> None:
    ring = Ring(tmp_path, 1600, lambda run_id: header(run_id))
    lab = bench(ring=ring)
    lab.blocks(0, 60)
    lab.recorder.inbox.put(None)
    lab.recorder.join()
    ring.close(keep=True)
    kept = sorted(sample for path in ring.place.glob("*.journal") for sample in contents(path))
    assert kept[-1] <= 5999 and len(kept) >= 1600
    assert len(kept) <= 1600 * 1.25 + 400
    assert kept == list(range(kept[0], kept[-1] + 1))


def test_a_ring_that_cannot_be_written_is_no_trouble_for_a_run(
    bench: Callable[..., Bench], disk: Disk, tmp_path: Path
) -> None:
    ring = Ring(tmp_path / "other", 1600, lambda run_id: header(run_id))
    (tmp_path / "other").write_text("in the way")
    lab = bench(ring=ring)
    lab.blocks(0, 5)
    lab.until(lambda: bool(ring.trouble))
    journal = lab.begin()
    lab.blocks(5, 5)
    lab.end()
    assert sorted(contents(journal)) == list(range(500, 1000))


def test_a_second_arming_and_a_bad_folder_are_refused(bench: Callable[..., Bench], tmp_path: Path) -> None:
    lab = bench()
    lab.begin()
    with pytest.raises(RequestRefused, match="already"):
        lab.begin("other")
    lab.end()
    with pytest.raises(RequestRefused, match="exists already"):
        lab.begin()
    lab.folder = tmp_path / "not there"
    with pytest.raises(RequestRefused, match="cannot be created"):
        lab.begin("third")


def test_ending_the_process_closes_the_journal_in_good_order(tmp_path: Path) -> None:
    lab = Bench(tmp_path)
    journal = lab.begin()
    lab.blocks(0, 7)
    lab.recorder.inbox.put(None)
    lab.recorder.join()
    with read_journal(journal) as opened:
        assert opened.closed
        assert opened.n_samples == 700

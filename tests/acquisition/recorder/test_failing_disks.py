"""A disk that is full, slow or broken costs no sample as long as another place takes the run."""

from __future__ import annotations

import errno
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from daq_app.acquisition.messages.items import Lost, Noted
from daq_app.acquisition.messages.published import EventMessage
from daq_app.runfile import JournalWriter, read_journal
from tests.support.recorder.recorder_bench import N_CHANNELS, Bench, Disk, contents


def test_a_full_disk_costs_nothing_once_there_is_room_again(bench: Callable[..., Bench], disk: Disk) -> None:
    lab = bench()
    journal = lab.begin_and_keep(5)
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
    journal = lab.begin_and_keep(5)
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
    journal = lab.begin_and_keep(5)
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
    journal = lab.begin_and_keep(5)

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
    journal = lab.begin_and_keep(5)
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

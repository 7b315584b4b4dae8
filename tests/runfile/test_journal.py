"""The journal as a recorder uses it: what was appended comes back, and failures say what is safe."""

from __future__ import annotations

import errno
import os
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from daq_app.runfile import (
    BusyError,
    FolderLock,
    Gap,
    JournalDeviceError,
    JournalDiskFull,
    JournalSlowDisk,
    JournalWriter,
    RunFileError,
    RunHeader,
    finalise,
    read_journal,
)
from daq_app.runfile.journal import writer as journal
from daq_app.runfile.journal.locks import journal_locked


def whole(path: Path) -> np.ndarray:
    with read_journal(path) as contents:
        return np.concatenate([window for _, window in contents.windows(777)], axis=1)


def test_what_was_appended_comes_back(tmp_path: Path, make_journal, header: RunHeader) -> None:
    path = tmp_path / "run.journal"
    readings = make_journal(path, gap_after=2)
    with read_journal(path) as contents:
        assert contents.header == header
        assert contents.closed and not contents.damage and contents.tail_bytes == 0
        assert (contents.first_sample, contents.n_samples) == (1000, readings.shape[1])
        assert contents.gaps == (Gap(2200, 150, "the chassis was off the network"),)
        assert [(e.kind, e.sample, e.text, e.data) for e in contents.events] == [
            ("state", 1000, "armed, θ steady", {"theta": 0.07})
        ]
    np.testing.assert_array_equal(whole(path), readings)


def test_jump_ahead_becomes_a_gap_and_going_back_is_refused(tmp_path: Path, header: RunHeader) -> None:
    path = tmp_path / "run.journal"
    block = np.ones((4, 10))
    with JournalWriter(path, header) as writer:
        writer.append_block(0, block)
        writer.append_block(25, block)
        with pytest.raises(ValueError, match="35 is the next"):
            writer.append_block(30, block)
    with read_journal(path) as contents:
        assert contents.gaps == (Gap(10, 15, "samples never arrived"),)


def test_sync_acknowledges_what_was_written(tmp_path: Path, header: RunHeader) -> None:
    with JournalWriter(tmp_path / "run.journal", header) as writer:
        writer.append_block(50, np.ones((4, 10)))
        assert writer.acknowledged_sample == 0
        assert writer.sync() == 60 == writer.acknowledged_sample


def test_short_writes_are_continued(tmp_path: Path, make_journal, monkeypatch: pytest.MonkeyPatch) -> None:
    real_write = os.write
    monkeypatch.setattr(journal.os, "write", lambda fd, data: real_write(fd, data[:1000]))
    path = tmp_path / "run.journal"
    readings = make_journal(path)
    monkeypatch.undo()
    np.testing.assert_array_equal(whole(path), readings)


def test_full_disk_says_what_is_safe_and_recording_continues_when_there_is_room(
    tmp_path: Path, header: RunHeader, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.journal"
    first, second = np.ones((4, 100)), np.full((4, 100), 2.0)
    real_write = os.write

    def full(fd: int, data: memoryview) -> int:
        if len(data) < 3000:
            raise OSError(errno.ENOSPC, "No space left on device")
        return real_write(fd, data[:1000])

    with JournalWriter(path, header) as writer:
        writer.append_block(0, first)
        writer.sync()
        monkeypatch.setattr(journal.os, "write", full)
        with pytest.raises(JournalDiskFull, match="up to sample 100") as caught:
            writer.append_block(100, second)
        assert caught.value.safe_sample == 100
        monkeypatch.undo()
        writer.append_block(100, second)
    np.testing.assert_array_equal(whole(path), np.concatenate([first, second], axis=1))
    with read_journal(path) as contents:
        assert not contents.damage


def test_failed_flush_acknowledges_nothing_ever_after(
    tmp_path: Path, header: RunHeader, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer = JournalWriter(tmp_path / "run.journal", header)
    writer.append_block(0, np.ones((4, 10)))
    writer.sync()
    writer.append_block(10, np.ones((4, 10)))

    def fail(fd: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(journal, "fsync_data", fail)
    with pytest.raises(JournalDeviceError) as caught:
        writer.sync()
    monkeypatch.undo()
    # The kernel may report success now although it dropped the pages: the writer must not believe it.
    with pytest.raises(JournalDeviceError):
        writer.sync()
    with pytest.raises(JournalDeviceError):
        writer.append_block(20, np.ones((4, 10)))
    assert caught.value.safe_sample == 10 == writer.acknowledged_sample
    writer.abandon()


def test_slow_flush_is_reported_and_does_not_stop_appending(
    tmp_path: Path, header: RunHeader, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, released = threading.Event(), threading.Event()
    real = journal.fsync_data
    writer = JournalWriter(tmp_path / "run.journal", header)
    monkeypatch.setattr(journal, "fsync_data", lambda fd: (begun.set(), released.wait(30), real(fd)))
    writer.append_block(0, np.ones((4, 10)))
    with pytest.raises(JournalSlowDisk, match=r"for 0\.01 s") as caught:
        writer.sync(timeout_s=0.01)
    assert caught.value.safe_sample == 0
    assert begun.wait(30)
    writer.append_block(10, np.ones((4, 10)))
    released.set()
    assert writer.sync(timeout_s=30) == 10  # the flush that was under way did not promise the later block
    assert writer.sync(timeout_s=30) == 20
    writer.close()


def test_a_journal_is_never_overwritten(tmp_path: Path, make_journal, header: RunHeader) -> None:
    path = tmp_path / "run.journal"
    readings = make_journal(path)
    with pytest.raises(RunFileError, match="exists already"):
        JournalWriter(path, header)
    np.testing.assert_array_equal(whole(path), readings)


def test_missing_folder_is_told(tmp_path: Path, header: RunHeader) -> None:
    with pytest.raises(RunFileError, match="cannot be created"):
        JournalWriter(tmp_path / "nowhere" / "run.journal", header)


def test_a_journal_being_written_is_locked(tmp_path: Path, header: RunHeader) -> None:
    path = tmp_path / "run.journal"
    with JournalWriter(path, header), pytest.raises(BusyError), journal_locked(path):
        pass
    with journal_locked(path):
        pass


def test_two_recorders_never_share_a_folder(tmp_path: Path) -> None:
    with FolderLock(tmp_path), pytest.raises(BusyError, match=f"process {os.getpid()}"):
        FolderLock(tmp_path)
    FolderLock(tmp_path).release()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows lets nobody delete an open file")
def test_a_deleted_lock_file_does_not_let_a_second_recorder_in(tmp_path: Path) -> None:
    with FolderLock(tmp_path):
        (tmp_path / ".recorder.lock").unlink()
        with pytest.raises(BusyError, match="in use by another recorder"):
            FolderLock(tmp_path)
    FolderLock(tmp_path).release()


@pytest.mark.parametrize("link", ["symlink_to", "hardlink_to"])
def test_a_lock_never_writes_through_a_link(tmp_path: Path, link: str) -> None:
    runs, victim = tmp_path / "runs", tmp_path / "victim"
    runs.mkdir()
    victim.write_text("precious", encoding="utf-8")
    try:
        getattr(runs / ".recorder.lock", link)(victim)
    except OSError:
        pytest.skip("this system lets no test make links")
    with pytest.raises(RunFileError, match="is a link to another file"):
        FolderLock(runs)
    assert victim.read_text(encoding="utf-8") == "precious"


def test_a_link_at_the_temporary_name_of_a_run_is_not_written_through(tmp_path: Path, header) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious", encoding="utf-8")
    with JournalWriter(tmp_path / "a.journal", header) as writer:
        writer.append_block(0, np.ones((4, 3)))
    try:
        (tmp_path / "a.h5.tmp").symlink_to(victim)
    except OSError:
        pytest.skip("this system lets no test make links")
    finalise(tmp_path / "a.journal", tmp_path / "a.h5")
    assert victim.read_text(encoding="utf-8") == "precious"

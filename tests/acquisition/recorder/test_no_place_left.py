"""Folders that vanish and disks that all fail: memory holds what it can, and what is lost is counted."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from daq_app.acquisition.pipeline.unwritten import Unwritten
from daq_app.runfile import read_journal
from tests.support.recorder.recorder_bench import N_CHANNELS, Bench, Disk, contents


@pytest.mark.skipif(os.name == "nt", reason="Windows does not delete a file that is open")
def test_a_folder_deleted_under_the_run_costs_nothing(bench: Callable[..., Bench], tmp_path: Path) -> None:
    lab = bench(tmp_path / "spare")
    lab.folder = tmp_path / "runs"
    lab.folder.mkdir()
    journal = lab.begin_and_keep(5)
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
    lab.begin_and_keep(5)
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
    lab.begin_and_keep(5)
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
    journal = lab.begin_and_keep(5)
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
    lab.begin_and_keep(5)
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
    lab.begin_and_keep(5)
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

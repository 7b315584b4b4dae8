"""Blocks reach the journal first, and each run begins and ends where it was ordered to."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from daq_app.acquisition.messages.items import Arrived, End, Item, RequestRefused
from daq_app.acquisition.pipeline.recent import Recent
from daq_app.runfile import read_journal
from tests.support.recorder.recorder_bench import N_CHANNELS, Bench, Disk, contents


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


def test_a_run_begins_with_what_was_in_memory_before_its_order(bench: Callable[..., Bench]) -> None:
    lab = bench(recent=Recent(1000))
    lab.blocks(0, 30)
    lab.until(lambda: lab.recorder.status.sample == 3000)
    journal = lab.begin(before_samples=450)
    lab.blocks(30, 5)
    lab.end()
    assert sorted(contents(journal)) == list(range(2500, 3500)), "whole blocks"


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

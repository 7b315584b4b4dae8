"""The last minutes on disk, and a release that nobody armed."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from daq_app.acquisition.messages.items import Arrived, End
from daq_app.acquisition.pipeline.recent import Recent
from daq_app.acquisition.pipeline.ring import Ring
from drivers import Block
from tests.support.recorder.recorder_bench import Bench, Disk, contents, header, readings


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


def test_a_run_whose_end_no_disk_takes_keeps_no_release_from_being_recorded(
    bench: Callable[..., Bench], disk: Disk
) -> None:
    """The wall goes on while the disk is full: the run that is over waits, the release is a run as well."""
    lab = bench(recent=Recent(2000))
    first = lab.begin_and_keep(5)
    disk.full = True
    lab.recorder.inbox.put(End("stopped", 500, "Stopped by the operator"))
    lab.blocks(5, 5)
    lab.until(lambda: lab.recorder.status.sample == 1000)
    second = lab.begin("unarmed", before_samples=2000, kept=True)
    lab.blocks(10, 5)
    lab.until(lambda: lab.recorder.status.sample == 1500)
    disk.full = False
    lab.recorder.inbox.put(End("complete", 1500, "At rest"))
    lab.until(lambda: len(lab.handed) == 2)
    assert [recorded.end.outcome for recorded in lab.handed] == ["stopped", "complete"]
    assert contents(first) == {n: float(n) for n in range(500)}
    assert contents(second) == {n: float(n) for n in range(500, 1500)}


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


def test_samples_from_before_a_run_do_not_make_its_disk_slow(bench: Callable[..., Bench]) -> None:
    """They were read long before the order; what the disk takes is counted from there."""
    lab = bench(recent=Recent(1000))
    long_ago_s = time.perf_counter() - 3600.0
    for n in range(10):
        lab.recorder.inbox.put(Arrived(Block(n * 100, readings(n * 100), 0, 0), long_ago_s))
    lab.until(lambda: lab.recorder.status.sample == 1000)
    journal = lab.begin(before_samples=1000)
    lab.end()
    assert contents(journal) == {n: float(n) for n in range(1000)}
    assert 0.0 < lab.recorder.latency.worst_ms < 3_500_000.0

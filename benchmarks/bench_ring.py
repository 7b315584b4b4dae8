"""What recording the last minutes into the ring adds: processor time of the reader's and recorder's process.

Everything is the same in both halves of a round, the ring apart: 41 channels at 4000 Hz through the real
nidaqmx client from a simulated device server in a process of its own, no run, no analysis, no viewer.
"""

from __future__ import annotations

import statistics
import tempfile
import threading
import time
from pathlib import Path

from benchmarks.bench_acquisition import RIG
from benchmarks.support.effort import Effort
from benchmarks.support.figure import Figure
from daq_app.acquisition.messages.items import Item, Lost, SourceEnded
from daq_app.acquisition.pipeline.reader import Reader
from daq_app.acquisition.pipeline.recorder import Recorder
from daq_app.acquisition.pipeline.ring import Ring
from daq_app.acquisition.process.simulated import SimulatedServer
from daq_app.config import load_rig, plan_tasks
from daq_app.runfile import RunHeader
from drivers import open_driver

_ROUNDS = 5
_BLOCKS = 150
"""15 s of reads in each half of a round."""
_WARM_BLOCKS = 10


def _processor_percent(connection: str, folder: Path | None, blocks: int) -> float:
    """Share of a core that this process takes while it reads; `folder`: where a ring is kept, or None."""
    rig = load_rig(RIG)
    plan = plan_tasks(rig)
    lost: list[int] = []
    warm, enough, ended = threading.Event(), threading.Event(), threading.Event()
    taken = 0

    def forward(item: Item) -> None:
        nonlocal taken
        taken += 1
        if isinstance(item, Lost):
            lost.append(item.n_samples)
        elif isinstance(item, SourceEnded):
            ended.set()
        elif taken == _WARM_BLOCKS:
            warm.set()
        elif taken == _WARM_BLOCKS + blocks:
            enough.set()

    def header_of(run_id: str) -> RunHeader:
        units = tuple(channel.reading_unit for channel in rig.channels)
        return RunHeader(
            run_id=run_id, channel_ids=rig.channel_ids, reading_units=units, rate_hz=plan.rate_hz
        )

    ring = None
    if folder is not None:
        ring = Ring(folder, round(rig.acquisition.ring_s * plan.rate_hz), header_of)
        ring.start()
    recorder = Recorder(forward, lambda event: None, lambda recorded: None, ring=ring)
    recorder.start()
    reader = Reader(lambda: open_driver(connection), plan, recorder.inbox.put)
    reader.start()
    _wait_for(warm)
    # The system's own count goes in ticks of 10 ms, which is more than a quick run takes.
    before_s = time.process_time()
    _wait_for(enough)
    used_s = time.process_time() - before_s
    reader.request_stop()
    _wait_for(ended)
    recorder.inbox.put(None)
    recorder.join()
    trouble = "" if ring is None else ring.trouble
    if ring is not None:
        ring.close(keep=False)
    if lost or trouble:
        raise RuntimeError(f"{sum(lost)} samples were lost; the ring says {trouble or 'nothing'}")
    return 100.0 * used_s / (blocks * plan.read_samples / plan.rate_hz)


def _wait_for(event: threading.Event) -> None:
    if not event.wait(120.0):
        raise RuntimeError("the simulated server gave no samples")


def figures(effort: Effort) -> list[Figure]:
    """Processor time without the ring, with it, and the median difference of the rounds."""
    rounds, blocks = effort.of(_ROUNDS, 1), effort.of(_BLOCKS, 5)
    without, with_ring = [], []
    with (
        tempfile.TemporaryDirectory() as name,
        SimulatedServer(RIG, ["--speed", "1", "--wall", "commanded"]) as server,
    ):
        for number in range(rounds):
            without.append(_processor_percent(server.connection, None, blocks))
            with_ring.append(_processor_percent(server.connection, Path(name) / str(number), blocks))
    added = [high - low for high, low in zip(with_ring, without, strict=True)]
    unit = "% of a core"
    note = f"median of rounds of {', '.join(f'{value:.2f}' for value in added)} %; processor time"
    return [
        Figure("reader and recorder without the ring", statistics.median(without), unit, rounds),
        Figure("the same with the ring", statistics.median(with_ring), unit, rounds),
        Figure("the ring adds", statistics.median(added), unit, rounds, aim=2.0, note=note),
    ]

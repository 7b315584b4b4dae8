"""Acquisition through the real nidaqmx client: how much faster than needed, at what cost, how soon on disk.

Three measurements on simulated device servers in processes of their own: the fastest hardware clock
that is recorded with nothing lost (journal on), processor time of client and recorder at the real
rate, and the time from the return of a read to the flushed disk.
"""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path

import psutil

from benchmarks.support.effort import Effort
from benchmarks.support.figure import Figure
from daq_app.acquisition import AcquisitionProcess
from daq_app.acquisition.messages.items import Begin, End, Item, Lost, SourceEnded, Started
from daq_app.acquisition.messages.published import HealthMessage, State, StateMessage
from daq_app.acquisition.pipeline.reader import Reader
from daq_app.acquisition.pipeline.recorder import Recorder
from daq_app.acquisition.process.simulated import SimulatedServer
from daq_app.config import load_rig, plan_tasks
from daq_app.runfile import RunHeader
from drivers import open_driver

RIG = Path(__file__).parents[1] / "configs" / "fr1.toml"
_SPEEDS = (10, 20, 30, 40, 44, 48, 52, 60, 80)
_THROUGHPUT_S = 5.0
_REAL_RATE_S = 20.0
_BACKLOG_SAMPLES = 20_000
"""A quarter of the device's buffer."""


@dataclass(frozen=True, slots=True)
class Throughput:
    """One sustained recording."""

    times_real: float
    """Recorded seconds per second, journal on, against 41 channels at 4000 Hz."""
    lost_samples: int
    backlog_samples: int
    """Left in the device's buffer at the end: small if the pace could be held for ever."""


def fastest(folder: Path, effort: Effort) -> list[Throughput]:
    """Faster and faster hardware clocks, up to the first that is not kept up with."""
    kept: list[Throughput] = []
    for speed in effort.of(_SPEEDS, _SPEEDS[:1]):
        with SimulatedServer(RIG, ["--speed", str(speed), "--wall", "commanded"]) as server:
            run = sustained(server.connection, folder, effort.of(_THROUGHPUT_S, 0.5))
        if run.lost_samples or run.backlog_samples > _BACKLOG_SAMPLES:
            break
        kept.append(run)
    return kept


def sustained(
    connection: str,
    folder: Path,
    seconds: float,
    *,
    hurry: bool = False,
    read_samples: int | None = None,
) -> Throughput:
    """Reader and recorder (no analysis, no viewer) as fast as the server can deliver.

    `hurry`: in the short pieces that are read while the wall rocks. `read_samples`: size of the reads, by
    default the rig's.
    """
    rig = load_rig(RIG)
    plan = plan_tasks(rig)
    plan = replace(plan, read_samples=read_samples or plan.read_samples)
    begun, ended = threading.Event(), threading.Event()
    lost: list[int] = []

    def forward(item: Item) -> None:
        match item:
            case Started():
                begun.set()
            case Lost(n_samples=count):
                lost.append(count)
            case SourceEnded():
                ended.set()

    closed = threading.Event()
    recorder = Recorder(forward, lambda event: None, lambda recorded: closed.set())
    recorder.start()
    reader = Reader(lambda: open_driver(connection), plan, recorder.inbox.put)
    reader.hurry(hurry)
    reader.start()
    if not begun.wait(60.0):
        raise RuntimeError("the simulated server gave no samples")
    header = RunHeader(
        run_id="bench",
        channel_ids=rig.channel_ids,
        reading_units=tuple(channel.reading_unit for channel in rig.channels),
        rate_hz=plan.rate_hz,
    )
    done: Future[Path] = Future()
    recorder.inbox.put(Begin(folder / f"bench-{time.monotonic_ns()}.journal", header, done))
    journal = done.result(30.0)
    started_s, started = time.perf_counter(), reader.next_sample
    time.sleep(seconds)
    elapsed_s = time.perf_counter() - started_s
    recorded, backlog = recorder.status.acknowledged_sample - started, reader.backlog_samples
    reader.request_stop()
    ended.wait(30.0)
    recorder.inbox.put(End("stopped", 0, "end of the benchmark"))
    closed.wait(30.0)
    recorder.inbox.put(None)
    recorder.join()
    journal.unlink()
    return Throughput(recorded / plan.rate_hz / elapsed_s if elapsed_s else 0.0, sum(lost), backlog)


@dataclass(frozen=True, slots=True)
class RealRate:
    """The whole acquisition process while it records at 4000 Hz with a viewer attached."""

    processor_percent: float
    """Share of one core that client, recorder, analysis and publisher take."""
    to_disk_p99_ms: float
    lost_samples: int
    memory_mb: float


def real_rate(connection: str, folder: Path, seconds: float) -> RealRate:
    """Arm, record for `seconds`, and look at the processor time of the acquisition process alone."""
    process = AcquisitionProcess(["--rig", str(RIG), "--out", str(folder), "--connection", connection])
    with process.client() as client:
        _wait_for(client.receive, lambda m: isinstance(m, StateMessage) and m.state is State.PREVIEWING)
        reply = client.request("arm", test="BENCH-L3-1")
        if not reply.ok:
            raise RuntimeError(reply.text)
        watched = psutil.Process(process.process.pid)
        begin, before = time.perf_counter(), watched.cpu_times()
        health: HealthMessage | None = None
        while time.perf_counter() - begin < seconds:
            received = client.receive(0.2)
            if received is not None and isinstance(received.message, HealthMessage):
                health = received.message
        after, elapsed_s = watched.cpu_times(), time.perf_counter() - begin
        memory_mb = watched.memory_info().rss / 2**20
        client.request("shutdown", force=1.0)
    process.wait(60.0)
    if health is None:
        raise RuntimeError("no health was published")
    used_s = (after.user - before.user) + (after.system - before.system)
    return RealRate(100.0 * used_s / elapsed_s, health.block_to_disk_ms_p99, health.lost_samples, memory_mb)


def client_and_recorder_percent(
    connection: str, folder: Path, seconds: float, *, hurry: bool = False
) -> float:
    """Processor time of reader and recorder alone at the real rate, per cent of a core."""
    me = psutil.Process()
    before = me.cpu_times()
    sustained(connection, folder, seconds, hurry=hurry)
    after = me.cpu_times()
    # Opening the tasks is not part of sampling: measured once without recording time.
    opening = me.cpu_times()
    sustained(connection, folder, 0.0)
    opened = me.cpu_times()
    used = (after.user - before.user) + (after.system - before.system)
    used -= (opened.user - opening.user) + (opened.system - opening.system)
    return 100.0 * used / seconds


def _wait_for(receive: Callable[[float], object], right: Callable[[object], bool]) -> None:
    deadline = time.monotonic() + 120.0
    while time.monotonic() < deadline:
        received = receive(0.5)
        if received is not None and right(getattr(received, "message", None)):
            return
    raise RuntimeError("the acquisition process did not start to sample")


def figures(effort: Effort) -> list[Figure]:
    """All figures of the acquisition."""
    seconds = effort.of(_REAL_RATE_S, 2.0)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        kept = fastest(folder, effort)
        with SimulatedServer(RIG, ["--speed", "1", "--wall", "commanded"]) as real:
            lean = client_and_recorder_percent(real.connection, folder, seconds)
            rocking = client_and_recorder_percent(real.connection, folder, seconds, hurry=True)
            whole = real_rate(real.connection, folder / "runs", seconds)
    machine = f"server in its own process on the same {psutil.cpu_count()} cores"
    return [
        Figure(
            "sustained, journal on",
            kept[-1].times_real if kept else 0.0,
            "× 41 × 4000 Hz",
            runs=len(kept),
            aim=40.0,
            better="high",
            note=f"fastest clock of {_SPEEDS} with nothing lost; {machine}",
        ),
        Figure("client and recorder at the real rate", lean, "% of a core", aim=10.0, note="journal on"),
        Figure(
            "the same, in the short reads of a rocking wall",
            rocking,
            "% of a core",
            aim=10.0,
            note="20 ms instead of 100 ms",
        ),
        Figure(
            "whole process at the real rate",
            whole.processor_percent,
            "% of a core",
            note="with live analysis and a viewer",
        ),
        Figure(
            "block to disk, p99", whole.to_disk_p99_ms, "ms", aim=30.0, note="from the read's return to fsync"
        ),
        Figure("lost at the real rate", float(whole.lost_samples), "samples", aim=0.0),
        Figure("memory of the process", whole.memory_mb, "MB"),
    ]

"""Runs on disk: journal, saving, verifying, export to each format, import of a large TDMS.

The recording is 41 channels at 4000 Hz of noise and slow motion, quantised like an NI 9205.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.support.effort import Effort
from benchmarks.support.figure import Figure
from daq_app.config import Rig, load_rig
from daq_app.runfile import JournalWriter, RunHeader, finalise, verify
from daq_app.runfile.exporters import FORMATS, export_run

RIG = Path(__file__).parents[1] / "configs" / "fr1.toml"
RATE_HZ = 4000
BLOCK = 400
SECONDS = 60
FLUSH_S = 0.1
LSB = 20 / 65536
RUNS = 3
IN_TIME_BLOCKS = 100
IMPORTED_MB = 100.0

_MEASURED_IMPORT = """
import sys, threading, time, psutil
from pathlib import Path
from daq_app.config import load_rig
from daq_app.runfile.importers import import_file
import daq_app.runfile.importers.formats.from_tdms, daq_app.runfile.integrity.saving
rig, source, out = map(Path, sys.argv[1:])
process = psutil.Process()
before = peak = process.memory_info().rss
done = threading.Event()
def watch():
    global peak
    while not done.wait(0.005):
        peak = max(peak, process.memory_info().rss)
threading.Thread(target=watch, daemon=True).start()
started = time.perf_counter()
import_file(source, load_rig(rig), rig.read_text(encoding="utf-8"), out)
elapsed = time.perf_counter() - started
done.set()
print(elapsed, (peak - before) / 1e6)
"""


def figures(effort: Effort) -> list[Figure]:
    """All figures; the disk is that of the system's folder for temporary files."""
    rig = load_rig(RIG)
    runs = effort.of(RUNS, 1)
    readings = _readings(len(rig.channels), effort.of(SECONDS, 1) * RATE_HZ)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        found = _journal(folder, rig, readings, runs)
        found += [_latency(folder, rig, readings, effort.of(IN_TIME_BLOCKS, 5))]
        found += _saving(folder, readings, runs)
        found += _exports(folder, _seconds(readings))
        found += _import(folder, rig, readings, effort.of(IMPORTED_MB, 2.0))
    return found


def _readings(n_channels: int, n_samples: int) -> NDArray[np.float64]:
    rng = np.random.default_rng(1)
    motion = 3 * np.sin(np.arange(n_samples) / 700) * rng.random((n_channels, 1))
    return np.round((motion + 2e-3 * rng.normal(size=(n_channels, n_samples))) / LSB) * LSB


def _header(rig: Rig) -> RunHeader:
    return RunHeader(
        run_id="benchmark",
        test="benchmark",
        rig_name=rig.name,
        rig_text=RIG.read_text(encoding="utf-8"),
        channel_ids=rig.channel_ids,
        reading_units=tuple(channel.reading_unit for channel in rig.channels),
        rate_hz=float(RATE_HZ),
    )


def _write(path: Path, rig: Rig, readings: NDArray[np.float64]) -> None:
    """As fast as it goes, flushed ten times a second as the recorder does."""
    with JournalWriter(path, _header(rig)) as writer:
        due = time.perf_counter() + FLUSH_S
        for first in range(0, readings.shape[1], BLOCK):
            writer.append_block(first, readings[:, first : first + BLOCK])
            if time.perf_counter() > due:
                writer.sync()
                due += FLUSH_S
        writer.sync()


def _timed(action: Callable[[int], object], runs: int) -> float:
    """Median seconds of `runs` runs."""
    times = []
    for number in range(runs):
        started = time.perf_counter()
        action(number)
        times.append(time.perf_counter() - started)
    return statistics.median(times)


def _seconds(readings: NDArray[np.float64]) -> float:
    return readings.shape[1] / RATE_HZ


def _journal(folder: Path, rig: Rig, readings: NDArray[np.float64], runs: int) -> list[Figure]:
    seconds = _timed(lambda number: _write(folder / f"speed-{number}.journal", rig, readings), runs)
    megabytes = readings.nbytes / 1e6
    return [
        Figure(
            "journal with CRC, flushed ten times a second",
            megabytes / seconds,
            "MB/s",
            runs,
            aim=52.5,
            better="high",
            note="aim: 40 × 41 channels × 4000 Hz",
        ),
        Figure(
            "the same as a multiple of the real rate",
            _seconds(readings) / seconds,
            "×",
            runs,
            aim=40,
            better="high",
        ),
    ]


def _latency(folder: Path, rig: Rig, readings: NDArray[np.float64], blocks: int) -> Figure:
    """Block handed over → flushed, at the real rate."""
    latencies = []
    with JournalWriter(folder / "latency.journal", _header(rig)) as writer:
        started = time.perf_counter()
        for number in range(blocks):
            time.sleep(max(0.0, started + number * BLOCK / RATE_HZ - time.perf_counter()))
            begin = time.perf_counter()
            writer.append_block(number * BLOCK, readings[:, number * BLOCK : (number + 1) * BLOCK])
            writer.sync()
            latencies.append(time.perf_counter() - begin)
    return Figure(
        "block to disk at the real rate, p99",
        1e3 * float(np.percentile(latencies, 99)),
        "ms",
        blocks,
        aim=30,
        note=f"median {1e3 * statistics.median(latencies):.2f} ms",
    )


def _saving(folder: Path, readings: NDArray[np.float64], runs: int) -> list[Figure]:
    journal = folder / "speed-0.journal"
    saved = _timed(lambda number: finalise(journal, folder / f"run-{number}.h5"), runs)
    run = folder / "run-0.h5"
    proven = _timed(lambda number: verify(run), runs)
    size = run.stat().st_size / 1e6
    lasting = f"a run of {_seconds(readings):g} s"
    return [
        Figure(f"finalising {lasting}", saved, "s", runs, aim=3, note="written, read back, compared"),
        Figure(f"verifying {lasting}", proven, "s", runs),
        Figure(f"file of {lasting}", size, "MB", note=f"journal {readings.nbytes / 1e6:.0f} MB"),
    ]


def _exports(folder: Path, lasting_s: float) -> list[Figure]:
    found = []
    for format_ in FORMATS:
        started = time.perf_counter()
        path = export_run(folder / "run-0.h5", folder / "exported", format_)  # type: ignore[arg-type]
        seconds = time.perf_counter() - started
        note = f"{path.stat().st_size / 1e6:.0f} MB"
        found.append(Figure(f"export of {lasting_s:g} s to {format_}", seconds, "s", note=note))
        path.unlink()
    return found


def _import(folder: Path, rig: Rig, readings: NDArray[np.float64], megabytes: float) -> list[Figure]:
    """A TDMS of about `megabytes` in segments of a second, as LabVIEW streams it, in a process of its own."""
    from nptdms import ChannelObject, TdmsWriter

    source = folder / "large.tdms"
    n_samples = int(1e6 * megabytes / (8 * readings.shape[0]))
    properties = {"wf_increment": 1 / RATE_HZ, "unit_string": "V"}
    with TdmsWriter(str(source)) as writer:
        for first in range(0, n_samples, RATE_HZ):
            columns = np.arange(first, min(first + RATE_HZ, n_samples)) % readings.shape[1]
            writer.write_segment(
                [
                    ChannelObject("Measurement", channel_id, readings[row, columns], properties=properties)
                    for row, channel_id in enumerate(rig.channel_ids)
                ]
            )
    command = [sys.executable, "-c", _MEASURED_IMPORT, str(RIG), str(source), str(folder / "imported.h5")]
    answer = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    seconds, added_mb = map(float, answer)
    size = source.stat().st_size / 1e6
    return [
        Figure(
            "import of a TDMS",
            size / seconds,
            "MB/s",
            better="high",
            note=f"{size:.0f} MB in {seconds:.1f} s, proven",
        ),
        Figure("memory that the import adds", added_mb, "MB", note="peak over the start of the import"),
    ]

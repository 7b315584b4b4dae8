"""The recorder with its journal against a bare nidaqmx loop, both on one server, in blocks of 4000 samples.

The server's clock moves with the reads, so that both take what server and client can give together. The two
take turns, and the ratio of their medians is the figure: what else runs on the machine slows both.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import psutil

from benchmarks.bench_acquisition import RIG, sustained
from benchmarks.bench_daqmx_server import bare_loop
from benchmarks.support.effort import Effort
from benchmarks.support.figure import Figure
from daq_app.acquisition.process.simulated import SimulatedServer

_BLOCK = 4000
_TURNS = 5
_SECONDS = 5.0


def figures(effort: Effort) -> list[Figure]:
    """Ratio of the two, each in multiples of 41 channels at 4000 Hz, and what the recorder lost."""
    turns, seconds = effort.of(_TURNS, 1), effort.of(_SECONDS, 0.5)
    bare: list[float] = []
    recorded: list[float] = []
    lost = 0
    with tempfile.TemporaryDirectory() as name:
        for _ in range(turns):
            with SimulatedServer(RIG, ["--speed", "max", "--wall", "commanded"]) as server:
                port = server.connection.rpartition(":")[2]
                bare.append(bare_loop(port, _BLOCK, psutil.Process(), seconds)[0])
                run = sustained(server.connection, Path(name), seconds, read_samples=_BLOCK)
            recorded.append(run.times_real)
            lost += run.lost_samples
    loop, recorder = float(np.median(bare)), float(np.median(recorded))
    unit = "× 41 × 4000 Hz"
    return [
        Figure("bare nidaqmx loop, blocks of 4000", loop, unit, runs=turns),
        Figure("recorder with its journal, same server and blocks", recorder, unit, runs=turns),
        Figure("recorder against bare loop", recorder / loop, "", runs=turns, aim=0.9, better="high"),
        Figure("lost by the recorder", float(lost), "samples", runs=turns, aim=0.0),
    ]

"""Cost of one blind case of six runs: simulated, and written as run files."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.support.effort import Effort
from benchmarks.support.figure import Figure
from daq_app.config import parse_rig
from daq_app.gap.blind.making.case_files import write_case
from daq_app.gap.blind.world.campaign import draw_world
from daq_app.gap.blind.world.effects.catalogue import ENTRIES, draw

_RIG = Path(__file__).parents[1] / "configs" / "fr1.toml"
_RUNS = 6


def figures(effort: Effort) -> list[Figure]:
    """Processor time of this process, so that other load on the machine counts little."""
    runs = effort.of(_RUNS, 2)
    text = _RIG.read_text(encoding="utf-8")
    rig = parse_rig(text, str(_RIG))
    rng = np.random.default_rng(1)
    world = draw_world(rig, [draw(ENTRIES["viscous"], rig, rng, 0.5)], runs, rng)
    started = time.process_time()
    for _ in world.make():
        pass
    simulated = time.process_time() - started
    with tempfile.TemporaryDirectory() as folder:
        started = time.process_time()
        write_case(Path(folder), "case_0001", world, text, 0)
        whole = time.process_time() - started
        size = sum(path.stat().st_size for path in Path(folder).glob("*.h5"))
    case = f"blind case of {runs} runs"
    return [
        Figure(f"{case}, simulated", simulated, "s of processor time"),
        Figure(f"{case}, simulated and written", whole, "s of processor time", aim=5.0),
        Figure(f"{case}, size", size / 1e6, "MB"),
    ]

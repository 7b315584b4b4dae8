"""How often the reader reads: by the rig file's period, and no faster than real time while a run is saved."""

from __future__ import annotations

import queue
import re
import threading
from pathlib import Path

import pytest

from daq_app.acquisition.messages.items import Arrived, Item, Noted, SourceEnded
from daq_app.acquisition.pipeline.reader import Reader
from daq_app.acquisition.process.simulated import SimulatedServer
from daq_app.config import load_rig
from daq_app.config.planning.planner import plan_tasks
from drivers import open_driver


@pytest.mark.parametrize("period_s", [0.1, 1.0])
def test_every_read_brings_the_whole_period_and_none_is_told_as_late(
    configs: Path, tmp_path: Path, period_s: float
) -> None:
    text = (configs / "fr1.toml").read_text(encoding="utf-8")
    rig_file = tmp_path / "rig.toml"
    changed, times = re.subn(r"(?m)^read_period_s = .*$", f"read_period_s = {period_s}", text)
    rig_file.write_text(changed, encoding="utf-8")
    assert times == 1
    plan = plan_tasks(load_rig(rig_file))
    items: queue.SimpleQueue[Item] = queue.SimpleQueue()
    with SimulatedServer(rig_file, ["--speed", "max", "--wall", "commanded"]) as server:
        reader = Reader(lambda: open_driver(server.connection), plan, items.put, speed=float("inf"))
        reader.start()
        blocks = []
        while len(blocks) < 5:
            item = items.get(timeout=60.0)
            assert not isinstance(item, (Noted, SourceEnded)), item
            if isinstance(item, Arrived):
                blocks.append(item.block)
        reader.request_stop()
        reader.join()
    assert [block.n_samples for block in blocks] == [plan.read_samples] * 5
    assert plan.read_samples == round(period_s * plan.rate_hz)


def test_a_clock_that_moves_with_the_reads_goes_at_the_real_rate_while_a_run_is_saved(configs: Path) -> None:
    """Read as fast as it answers, a simulated wall takes the processor from what is waited for."""
    rig_file = configs / "fr1.toml"
    plan = plan_tasks(load_rig(rig_file))
    items: queue.SimpleQueue[Item] = queue.SimpleQueue()
    saving = threading.Event()
    saving.set()
    with SimulatedServer(rig_file, ["--speed", "max", "--wall", "commanded"]) as server:
        reader = Reader(
            lambda: open_driver(server.connection), plan, items.put, None, float("inf"), saving.is_set
        )
        reader.start()
        times_s = [item.arrived_s for _ in range(6) if isinstance(item := items.get(timeout=60.0), Arrived)]
        reader.request_stop()
        reader.join()
    assert times_s[-1] - times_s[0] >= 0.9 * (len(times_s) - 1) * plan.read_samples / plan.rate_hz

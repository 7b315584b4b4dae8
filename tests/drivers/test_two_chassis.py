"""Two cDAQ-9188, which have no clock in common, synchronised by cables between their PFI terminals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq_app.config import ConfigError, load_rig, plan_tasks
from drivers import open_driver

CABLE = '[hardware.clock_cable]\nclock = "PFI0"\ntrigger = "PFI1"\n\n'


def two_chassis(configs: Path, folder: Path, product: str, cable: str) -> Path:
    """FR1 with the modules of the slots 3 and 4 in a second chassis."""
    text = (configs / "fr1.toml").read_text(encoding="utf-8").replace("cDAQ-9178", product)
    lines = text.splitlines(keepends=True)
    third = next(i for i, line in enumerate(lines) if line.lstrip().startswith("{ slot = 3"))
    lines.insert(third, f']\n[[hardware.chassis]]\nname = "cDAQ2"\nproduct = "{product}"\nmodules = [\n')
    text = "".join(lines).replace("cDAQ1Mod3", "cDAQ2Mod3").replace("cDAQ1Mod4", "cDAQ2Mod4")
    path = folder / "two.toml"
    path.write_text(text.replace("[[hardware.chassis]]", f"{cable}[[hardware.chassis]]", 1), encoding="utf-8")
    return path


def test_without_a_cable_the_rig_is_refused_with_what_would_help(configs: Path, tmp_path: Path) -> None:
    rig = load_rig(two_chassis(configs, tmp_path, "cDAQ-9188", ""))
    with pytest.raises(ConfigError, match=r"hardware\.clock_cable"):
        plan_tasks(rig)


def test_chassis_on_a_common_time_need_no_cable_and_one_task(configs: Path, tmp_path: Path) -> None:
    plan = plan_tasks(load_rig(two_chassis(configs, tmp_path, "cDAQ-9185", "")))
    assert [(task.role, task.clock_source) for task in plan.tasks] == [("master", "")]
    assert "synchronised over the network" in " ".join(note.text for note in plan.notes)


def test_with_cables_the_second_chassis_listens_to_the_first(configs: Path, tmp_path: Path) -> None:
    plan = plan_tasks(load_rig(two_chassis(configs, tmp_path, "cDAQ-9188", CABLE)))
    master, slave = plan.tasks
    names = {"cDAQ1": "cDAQ2", "cDAQ2": "cDAQ1"}
    first = master.exported_clock.split("/")[1]
    assert (master.exported_clock, master.exported_trigger) == (f"/{first}/PFI0", f"/{first}/PFI1")
    assert (slave.clock_source, slave.start_trigger_source) == (
        f"/{names[first]}/PFI0",
        f"/{names[first]}/PFI1",
    )
    assert any(f"{master.exported_clock} to {slave.clock_source}" in note.text for note in plan.notes)


def test_samples_of_both_chassis_are_taken_together(
    configs: Path, tmp_path: Path, laboratory: Callable[..., Any]
) -> None:
    path = two_chassis(configs, tmp_path, "cDAQ-9188", CABLE)
    lab = laboratory(str(path.with_suffix("")))
    driver = open_driver(lab.connection)
    driver.open(lab.plan)
    driver.start()
    blocks = [driver.read(1.0) for _ in range(5)]
    driver.close()

    readings = np.concatenate([block.readings for block in blocks], axis=1)
    skews = {p.channel.id: p.time_offset_s for task in lab.plan.tasks for p in task.channels}
    times = np.arange(readings.shape[1]) / lab.plan.rate_hz
    volts = [row for row, c in enumerate(lab.rig.channels) if c.measurement == "voltage"]
    assert {lab.rig.channels[row].physical_channel[:5] for row in volts} == {"cDAQ1", "cDAQ2"}
    for row in volts:
        instants = times + skews[lab.rig.channels[row].id]
        assert np.max(np.abs(readings[row] - 0.01 * (row + 1) - 0.01 * instants)) < 4e-4

"""A wall that rings turns its base against its bending, which moves crossings and peaks of the joint."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from daq_app.gap.blind.making.make import Order, make_case
from daq_app.gap.rocking_model.records import load_run
from daq_app.gap.rocking_model.study import diagnose_runs

RIG = Path(__file__).parents[3] / "configs" / "fr1.toml"
SEED = 5


def test_the_recoil_of_a_wall_that_rings_is_found_and_explains_what_joint_and_motion_show(
    tmp_path: Path,
) -> None:
    text = RIG.read_text(encoding="utf-8")
    order = Order(
        SEED, tmp_path / "out", tmp_path / "kept", (text,), 4, None, "ordinary", "", "slow_flexible_wall"
    )
    name = make_case(order, 0)
    label = json.loads(json.loads((tmp_path / "kept" / f"{name}.json").read_text(encoding="utf-8"))["label"])
    hidden = label["effects"][0]["parameters"]
    runs = [load_run(file) for file in sorted((tmp_path / "out" / name).glob("*.h5"))]

    result = diagnose_runs(runs, only=("flexible_wall", "viscous", "restitution_slope"))

    assert result.decision.effects == ("flexible_wall",)
    (recoil,) = [e for e in result.effect_parameters if e.name == "flexible_wall.recoil"]
    assert hidden["recoil"] > 0.05
    assert recoil.value == pytest.approx(hidden["recoil"], abs=0.03)

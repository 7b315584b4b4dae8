"""A wall that rings turns its base against its bending, which moves crossings and peaks of the joint."""

from __future__ import annotations

from pathlib import Path

import pytest

from daq_app.gap.rocking_model.records import load_run
from daq_app.gap.rocking_model.study import diagnose_runs
from tests.support.gap.blind_case import blind_case

SEED = 5


def test_the_recoil_of_a_wall_that_rings_is_found_and_explains_what_joint_and_motion_show(
    tmp_path: Path,
) -> None:
    files, hidden = blind_case(tmp_path, "ordinary", "slow_flexible_wall", seed=SEED, runs=4)
    runs = [load_run(file) for file in files]

    result = diagnose_runs(runs, only=("flexible_wall", "viscous", "restitution_slope"))

    assert result.decision.effects == ("flexible_wall",)
    (recoil,) = [e for e in result.effect_parameters if e.name == "flexible_wall.recoil"]
    assert hidden["recoil"] > 0.05
    assert recoil.value == pytest.approx(hidden["recoil"], abs=0.03)

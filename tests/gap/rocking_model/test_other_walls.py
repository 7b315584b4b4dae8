"""Walls of the blind check's world, which do what the simulator that the diagnosis fits with does not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from daq_app.config import parse_rig
from daq_app.gap.blind.making.case_files import write_case
from daq_app.gap.blind.making.make import Order, draw_case
from daq_app.gap.blind.world.campaign import draw_world
from daq_app.gap.blind.world.effects.catalogue import Drawn
from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.records import load_run
from daq_app.gap.rocking_model.study import diagnose_runs, prepare
from tests.support.gap.conditions import conditions_found


def _runs(folder: Path, seed: int, **effects: dict[str, float]) -> list[RockingRun]:
    """The features of four runs of a wall that has these effects."""
    rig_text = Path("configs/fr1.toml").read_text(encoding="utf-8")
    rig = parse_rig(rig_text, "configs/fr1.toml")
    drawn = [Drawn(name, "", "library", parameters, (), 1.0) for name, parameters in effects.items()]
    write_case(folder, "case", draw_world(rig, drawn, 4, np.random.default_rng(seed)), rig_text, 0)
    return prepare([load_run(path, rig) for path in sorted(folder.glob("*.h5"))])[0]


def _block(run: RockingRun, family: str) -> Block:
    return next(block for block in run.blocks if block.family == family)


def test_a_wall_that_bends_in_another_shape_is_no_floor_that_shakes(tmp_path: Path) -> None:
    """It bends with z to the 1.5th and not with the square: some of that has the shape of a shaking floor."""
    runs = _runs(tmp_path, 2, flexible_wall={"gain": 0.6, "frequency_hz": 12.0, "zeta": 0.01})
    assert _block(runs[0], "bending").ring[0] == pytest.approx(12.0, rel=0.02)
    assert conditions_found(runs) == set()


def test_a_wall_that_is_let_go_slowly_strikes_slower_than_from_rest(tmp_path: Path) -> None:
    """So the first impact kicks it less; what bends is as strong in every run."""
    bends = {"gain": 0.25, "frequency_hz": 12.0, "zeta": 0.012}
    runs = _runs(tmp_path, 4, flexible_wall=bends, slow_release={"tau_s": 0.35})
    assert conditions_found(runs) == set()
    kicks = [
        float(np.hypot(*(_block(run, "bending").values[k] for k in (2, 3))))  # sine, cosine in accelerometers
        for run in runs
    ]
    assert max(kicks) < 1.1 * min(kicks)
    for run in runs:
        taken = np.abs(run.grid.jumps / run.grid.approach)
        assert taken[0] == pytest.approx(float(np.median(taken[1:4])), abs=0.02)


def test_a_base_that_takes_milliseconds_to_give_way_is_no_delay_of_the_wires(tmp_path: Path) -> None:
    runs = _runs(tmp_path, 3, compliance={"phi_rad": 7e-4})
    for run in runs:
        block = _block(run, "wire")
        lag, step = (block.names.index(name) for name in ("lag", "step with moment"))
        sds = np.sqrt(np.diag(block.covariance))
        assert abs(block.values[lag]) < 3.0 * sds[lag]
        assert block.values[step] == pytest.approx(7e-4, rel=0.02)


@pytest.mark.heavy
def test_a_pair_that_a_glance_leaves_far_behind_is_fitted_to_its_end(tmp_path: Path) -> None:
    """A clock that runs 5 % wrong on a soft joint: at a glance a gain of the accelerometers led by 700."""
    texts = tuple(Path(f"configs/{name}.toml").read_text(encoding="utf-8") for name in ("fr1", "fr2"))
    world, rig_text, _ = draw_case(Order(502441, tmp_path, tmp_path, texts), 101)
    assert [effect.name for effect in world.effects] == ["winkler", "clock"]
    write_case(tmp_path, "case", world, rig_text, 0)
    runs = [load_run(path, world.rig) for path in sorted(tmp_path.glob("*.h5"))]
    result = diagnose_runs(runs, only=("clock", "winkler", "gain@accelerometer"))
    assert (result.decision.verdict, result.decision.effects) == ("pair", ("clock", "winkler"))

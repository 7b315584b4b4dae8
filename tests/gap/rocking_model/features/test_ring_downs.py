"""Ring-downs of the wall after impacts, from soft beds to squat walls."""

from __future__ import annotations

import pytest

from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.study import model_and_library, prepare
from tests.support.simulated_wall import simulate


def _bending(frequency_hz: float) -> tuple[Block, float]:
    """The block of the bending wall, and the kick that its wires show."""
    effects = {"flexible_wall": {"gain": 0.02, "frequency": frequency_hz, "zeta": 0.03}}
    (run,) = prepare(simulate(effects, (0.3,)))[0]
    block = next(b for b in run.blocks if b.kind == "bending")
    return block, float(block.values[block.names.index("sine in wires")])


@pytest.mark.parametrize("frequency_hz", [2.9, 4.6, 30.0])
def test_a_wall_that_rings_is_heard_from_2_to_42_hz(frequency_hz: float) -> None:
    block, kick = _bending(frequency_hz)
    assert block.values[block.names.index("frequency")] == pytest.approx(frequency_hz, rel=0.03)
    assert kick == pytest.approx(0.02, rel=0.2)


def test_the_library_lets_walls_ring_where_they_are_looked_for() -> None:
    library = model_and_library(prepare(simulate({}, (0.3,)))[0])[1]
    frequency = next(p for p in library["flexible_wall"].parameters if p.name == "frequency")
    assert frequency.low < 2.9 < 42.0 < frequency.high

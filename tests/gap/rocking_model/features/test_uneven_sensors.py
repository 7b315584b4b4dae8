"""Bending and turning of the wall where the sensors that are left stand unevenly about its middle."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.gap.rocking_model.features.oscillations.ring_response import bending, turning
from daq_app.gap.rocking_model.study import prepare
from tests.support.simulated_wall import simulate

ONE_END_OF_THE_TOP = ("WP-4", "AC-5")


@pytest.mark.parametrize(
    ("motion", "given", "seen_in"),
    [
        ("yaw", {"kick": 0.3, "frequency": 8.0, "zeta": 0.02}, "bending"),
        ("flexible_wall", {"gain": 0.008, "frequency": 9.5, "zeta": 0.02}, "turning"),
    ],
)
def test_what_turns_is_known_where_bending_is_looked_for_and_the_other_way_round(
    motion: str, given: dict[str, float], seen_in: str
) -> None:
    """With the sensors of one end of the top left out, those of the other end show both."""
    runs = [run.excluding(ONE_END_OF_THE_TOP) for run in simulate({motion: given}, (-0.35,))]
    (run,) = prepare(runs)[0]
    block = next(b for b in run.blocks if b.kind == seen_in)
    values = {f"{motion}.{parameter}": value for parameter, value in given.items()}
    predicted = {"bending": bending, "turning": turning}[seen_in](run, block, values)
    sd = np.sqrt(np.diag(block.covariance))
    for family in ("wires", "accelerometers"):
        chosen = [k for k, name in enumerate(block.names) if name.endswith(family)]
        assert np.max(np.abs(block.values / sd)[chosen]) > 8.0
        np.testing.assert_array_less(np.abs(block.values - predicted)[chosen], 3.0 * sd[chosen])

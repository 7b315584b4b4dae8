"""The study that closes the loop measures the gap of a rig file."""

from __future__ import annotations

from daq_app.gap.rocking_model.study import prepare
from studies.gap.loops import gap_of
from tests.support.gap.simulated_campaign import RIG, simulate

LEVELS = (0.25, -0.35)


def test_a_rig_file_leaves_what_it_does_not_say_of_a_wall() -> None:
    """Its own wall next to nothing beyond noise and scatter, and one that loses more by air by far more."""
    own, scatters = gap_of(RIG, prepare(simulate({}, 7, RIG, LEVELS))[0])
    lossy, _ = gap_of(RIG, prepare(simulate({"viscous": {"zeta": 0.01}}, 7, RIG, LEVELS))[0], scatters)
    assert own < 1.2
    assert lossy > 1.5 * own

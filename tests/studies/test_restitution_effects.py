"""The tables of errors under faults hold every effect that the simulator knows."""

from __future__ import annotations

from collections import Counter

from sim_hardware.library import ALL_EFFECTS
from studies.restitution.faults import FAULTS
from studies.restitution.sensors import SENSORS
from studies.restitution.walls import WALLS

BY_ITS_OWN_NAME = {
    "slow_response": "slow",
    "lag": "late",
    "hum": "hum",
    "gain": "gain",
    "polarity": "reversed",
    "drift": "drift",
}
"""Effects that `faults` puts in itself, by the kind of fault."""


def test_each_effect_of_the_simulator_is_in_a_table_with_two_sizes() -> None:
    counted = Counter(effect.effect.partition("@")[0] for effect in (*WALLS[1:], *SENSORS))
    kinds = Counter(fault.kind for fault in FAULTS)
    for spec in ALL_EFFECTS:
        times = counted[spec.name] + kinds[BY_ITS_OWN_NAME.get(spec.name, "none")] * (
            spec.name in BY_ITS_OWN_NAME
        )
        assert times >= 2, spec.name

"""Plugs that a diagnosis found in each other's places are put there in the simulator again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq_app.config import load_rig
from daq_app.gap.apply import apply_result, effects_found
from daq_app.gap.rocking_model.study import prepare
from sim_hardware.sensors.effects import Wiring, apply_sensor_effects
from tests.support.simulated_wall import RIG, short_rig, simulate

WIRES = [channel.id for channel in short_rig().channels if channel.family == "wire"]


def _result(exchanged: dict[str, str], turned: tuple[str, ...] = ()) -> dict[str, Any]:
    found = [{"name": "swap@wire.places", "value": 1.0}] if exchanged else []
    found += [{"name": "polarity.on", "value": 1.0}] if turned else []
    nuisance = {"alpha": 0.21, "p": 2.19, "r": 0.9, "half_base": 0.3255}
    return {
        "decision": "pair",
        "effect_parameters": found,
        "parameters": [{"name": k, "value": v} for k, v in nuisance.items()],
        "scatter": [],
        "notes": {"wiring": {"reversed": list(turned), "exchanged": exchanged}},
    }


@given(st.permutations(WIRES))
def test_any_order_of_plugs_is_made_of_exchanges_of_two(shown: list[str]) -> None:
    exchanged = {a: b for a, b in zip(WIRES, shown, strict=True) if a != b}
    if not exchanged:
        return
    channels = short_rig().channels
    wiring = Wiring(np.zeros((len(channels), 1)), np.arange(len(channels)))
    apply_sensor_effects(wiring, channels, effects_found(_result(exchanged)), 1)
    place = {channel.id: i for i, channel in enumerate(channels)}
    assert [channels[wiring.sensor_at[place[a]]].id for a in WIRES] == list(shown)


def test_exchanged_and_reversed_channels_of_runs_go_back_into_a_rig_file(tmp_path: Path) -> None:
    runs = simulate({"swap@WP-2+WP-5": {"places": 1.0}, "polarity@LV-A03+LV-B06": {"on": 1.0}}, (0.3,))
    prepared, _ = prepare(runs)
    wiring = prepared[0].wiring
    assert dict(wiring.exchanged) == {"WP-2": "WP-5", "WP-5": "WP-2"}
    assert wiring.reversed_ids == ("LV-A03", "LV-B06")
    out = tmp_path / "rig.toml"
    apply_result(_result(dict(wiring.exchanged), wiring.reversed_ids), RIG, out)
    effects = load_rig(out).simulation.effects
    assert effects == {"swap@WP-2+WP-5": {"places": 1.0}, "polarity@LV-A03+LV-B06": {"on": 1.0}}
    again = simulate({key: dict(values) for key, values in effects.items()}, (0.3,))
    np.testing.assert_array_equal(again[0].channels, runs[0].channels)


def test_a_channel_that_is_none_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="'WP-9'"):
        simulate({"swap@WP-2+WP-9": {"places": 1.0}}, (0.3,))

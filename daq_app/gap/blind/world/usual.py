"""What the wall and the amplifiers of any laboratory have, and nobody wants named.

A level leaves a lean, bricklaying two edges that are not alike, impacts an r that changes a little with speed
and side, mortar a bed that gives, carrier amplifiers a delay. The effects that cases hide do the same, only
more: each is simulated by the same rule.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from daq_app.config import Rig
from daq_app.gap.blind.world.effects.catalogue import Drawn, Parameters

_SIDES_S_RAD: Final = 8.0
"""Slope of r over the speed, s/rad, that goes with half a difference of r between the sides of 1."""


def draw_usual(rig: Rig, sizes: Mapping[str, float], rng: np.random.Generator) -> tuple[Drawn, ...]:
    """Small effects of these sizes, as far as `sizes` has them; each is drawn about its size."""
    tilt, uneven, slope, sides = rng.standard_normal(4).tolist()
    amplifier = float(rng.uniform())
    lvdts = tuple(channel.id for channel in rig.channels if channel.family == "lvdt")
    drawn: list[Drawn] = []

    def add(name: str, targets: tuple[str, ...] = (), **parameters: float) -> None:
        values: Parameters = dict(parameters)
        drawn.append(Drawn(name, "usual", "library", values, targets, 0.0))

    if lean := sizes.get("lean", 0.0):
        add("base_tilt", beta_rad=lean * tilt)
        add("alpha_asymmetry", delta_rad=lean * uneven)
    if varies := sizes.get("slope_of_r", 0.0):
        add("restitution_slope", k_s_rad=varies * slope)
        add("restitution_asymmetry", d=varies * sides / _SIDES_S_RAD)
    if bed := sizes.get("bed", 0.0):
        add("winkler", theta_c_rad=bed**2)
    if late := sizes.get("late", 0.0):
        add("filter_delay", lvdts, tau_s=late * amplifier)
    return tuple(drawn)

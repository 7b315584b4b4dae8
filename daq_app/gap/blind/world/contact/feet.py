"""What a wall of the contact engine stands on: the feet along its base that touch the floor.

The contact engine knows no lever arms: where the reaction acts, how much an impact takes and whether the
base slips follow from these shapes, their stiffness and their friction.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

from daq_app.gap.blind.world.effects.catalogue import Parameters
from daq_app.gap.blind.world.wall import GRAVITY_M_S2, Wall

STICKS: Final = 0.9
"""Coefficient of friction that no slender wall overcomes as it rocks (`needed_friction`)."""
_SHARP_M: Final = 1e-3
"""Radius of an edge that counts as sharp."""
_PADS: Final = 25
_BED_DAMPING: Final = 1.0
"""Damping of the wall's bounce on the whole bed, share of critical: it loses about what it loses on stone."""


@dataclass(frozen=True, slots=True)
class Foot:
    """A round foot, lowest at `x_m` along the base and `height_m` above the plane of the base."""

    x_m: float
    radius_m: float = _SHARP_M
    height_m: float = 0.0
    friction: float = STICKS
    spring: tuple[float, float] | None = None
    """(stiffness N/m, damping N s/m) towards the floor; None where stone meets stone."""


Feet = tuple[Foot, ...]


def feet(wall: Wall, effects: Mapping[str, Parameters]) -> Feet:
    """The feet of a wall with those of `effects` that change them; sharp edges at ±b/2 without."""
    changed: Feet = (Foot(-wall.half_width), Foot(wall.half_width))
    for name, change in FORMS.items():
        if name in effects:
            changed = change(wall, changed, effects[name])
    return changed


def _pivot_shift(wall: Wall, standing: Feet, q: Parameters) -> Feet:
    return tuple(replace(foot, x_m=math.copysign(wall.half_width - q["a_m"], foot.x_m)) for foot in standing)


def _alpha_asymmetry(wall: Wall, standing: Feet, q: Parameters) -> Feet:
    """α larger by `delta_rad` on the + side and smaller by as much on the other: both edges are off."""
    off = wall.centroid_height * math.tan(wall.alpha + q["delta_rad"]) - wall.half_width
    return tuple(replace(foot, x_m=foot.x_m + off) for foot in standing)


def _rounded(foot: Foot, radius: float) -> Foot:
    return replace(foot, x_m=math.copysign(abs(foot.x_m) - radius, foot.x_m), radius_m=radius)


def _rounded_edge(wall: Wall, standing: Feet, q: Parameters) -> Feet:
    return tuple(_rounded(foot, q["rho_m"]) for foot in standing)


def _one_round_edge(wall: Wall, standing: Feet, q: Parameters) -> Feet:
    """Outside: one edge worn round, the other sharp."""
    return (standing[0], _rounded(standing[1], q["rho_m"]))


def _stepped_edge(wall: Wall, standing: Feet, q: Parameters) -> Feet:
    """Outside: a strip along both edges has lost `height_m`: the wall turns on its inner edge first."""
    inner = wall.half_width - q["width_m"]
    outer = tuple(replace(foot, height_m=q["height_m"]) for foot in standing)
    return (*outer, Foot(-inner), Foot(inner))


def _damped_bed(wall: Wall, standing: Feet, q: Parameters) -> Feet:
    """Outside: an elastic bed without tension that takes what an impact takes: pads side by side, uplift
    at `theta_c_rad`."""
    stiffness = wall.mass_kg * GRAVITY_M_S2 / (q["theta_c_rad"] * wall.half_width)
    damping = 2.0 * _BED_DAMPING * math.sqrt(stiffness * wall.mass_kg)
    spring = (stiffness / _PADS, damping / _PADS)
    places = [wall.half_width * ((2 * k + 1) / _PADS - 1.0) for k in range(_PADS)]
    return tuple(Foot(x, spring=spring) for x in places)


def _slippery_base(wall: Wall, standing: Feet, q: Parameters) -> Feet:
    """Outside: friction that an impact overcomes, on both edges."""
    return tuple(replace(foot, friction=q["friction_share"] * needed_friction(wall)) for foot in standing)


def _slippery_edge(wall: Wall, standing: Feet, q: Parameters) -> Feet:
    """Outside: one edge stands on something that lets it slip, the other does not."""
    return (standing[0], replace(standing[1], friction=q["friction_share"] * needed_friction(wall)))


def needed_friction(wall: Wall) -> float:
    """Ratio of the impulses along and against the floor at a plastic impact of a sharp-edged block.

    The centre of mass comes with (h ω, −b/2 ω) and leaves with r (h ω, b/2 ω): h (1 − r) / (b/2 (1 + r)).
    """
    r = plastic_restitution(wall)
    return wall.centroid_height * (1.0 - r) / (wall.half_width * (1.0 + r))


def plastic_restitution(wall: Wall) -> float:
    """r of an impact at a sharp edge without bounce or slip: 1 − 2 m (b/2)² / I_O (Housner)."""
    half = wall.half_width
    return 1.0 - 2.0 * wall.mass_kg * half * half / wall.inertia_about(half)


FORMS: Final[dict[str, Callable[[Wall, Feet, Parameters], Feet]]] = {
    "pivot_shift": _pivot_shift,
    "rounded_edge": _rounded_edge,
    "one_round_edge": _one_round_edge,
    "stepped_edge": _stepped_edge,
    "alpha_asymmetry": _alpha_asymmetry,
    "damped_bed": _damped_bed,
    "slippery_base": _slippery_base,
    "slippery_edge": _slippery_edge,
}
"""Effects on the feet by name, in the order in which they apply."""

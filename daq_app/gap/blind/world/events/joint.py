"""Where the base stands on its joint: lever arm of the reaction, and where the joint has opened.

Every form answers two questions for an absolute rotation q ≥ 0 towards side s = ±1:

- `arm(q, s)`: horizontal distance, measured along the base, from the centroid's foot to the reaction;
- `contact(q, s)`: (x, lift): the wall turns about the base point x (signed) and is lifted, so that the
  joint below X opens by s·(x − X)·sin q + lift, metres.

Derived from the table of effects, written for scalars and arrays alike.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from daq_app.gap.blind.world.wall import Wall

Parameters = dict[str, float]
ArmFunction = Callable[[float, int], float]
ContactFunction = Callable[[Any, Any], tuple[Any, Any]]


@dataclass(frozen=True, slots=True)
class Joint:
    """Arm (scalars: the integrator calls it) and contact (arrays: the sensors call it)."""

    arm: ArmFunction
    contact: ContactFunction
    rise: Callable[[float], float]
    """Height of the turning point above the base (a rounded edge turns about its own centre)."""
    inertia_arm: float
    """Arm for the inertia about the turning point."""


def rigid(wall: Wall) -> Joint:
    """Sharp edges at x = ±b/2."""
    return _on_edges(wall.half_width)


def pivot_shift(wall: Wall, parameters: Parameters) -> Joint:
    """Crushed or soft edge: the wall turns about a point `a_m` inside the face (Eqns 2.1 to 2.3)."""
    return _on_edges(wall.half_width - parameters["a_m"])


def _on_edges(arm: float) -> Joint:
    """A wall that turns about x = ±`arm`, m."""
    return Joint(lambda q, s: arm, lambda q, s: (s * arm, 0.0 * q), lambda q: 0.0, arm)


def winkler(wall: Wall, parameters: Parameters) -> Joint:
    """Elastic bed without tension; uplift starts at `theta_c_rad`.

    In uplift the contact length is c = b √(θc/θ) and the pressure a triangle, so that the reaction
    lies c/3 inside the edge; before uplift the whole base bears and the arm is b/6 · θ/θc.
    """
    half, limit = wall.half_width, parameters["theta_c_rad"]

    def arm(q: float, s: int) -> float:
        if q <= limit:
            return half * q / (3.0 * limit)
        return half * (1.0 - 2.0 / 3.0 * math.sqrt(limit / q))

    def contact(q: Any, s: Any) -> tuple[Any, Any]:
        # The neutral axis is at the end of the contact; upright, the bed is already pressed by θc b/2.
        share = np.sqrt(limit / np.maximum(q, limit))
        inside = q <= limit
        x = np.where(inside, 0.0, half - 2.0 * half * share)
        return s * x, np.where(inside, 0.0, limit * half)

    return Joint(arm, contact, lambda q: 0.0, half)


def rounded_edge(wall: Wall, parameters: Parameters) -> Joint:
    """Edges worn to a radius `rho_m`, on which the wall rolls: the contact walks outwards with θ.

    Lever of the reaction: (b/2 − ρ) cos θ − (h − ρ) sin θ.
    """
    half, radius = wall.half_width, parameters["rho_m"]
    inner = half - radius

    def contact(q: Any, s: Any) -> tuple[Any, Any]:
        # A roll by q: body point x = inner + ρ q is on the ground, the centre of the edge ρ above it.
        opening_at_inner = radius * (1.0 - np.cos(q))
        return s * inner, opening_at_inner

    return Joint(lambda q, s: inner, contact, lambda q: radius, inner)


def cubic_joint(wall: Wall, parameters: Parameters) -> Joint:
    """Outside the library: a joint that hardens with θ³ instead of losing contact.

    arm = b/2 · x (3 − x²)/2 with x = θ/θj up to θj, b/2 beyond.
    """
    half, limit = wall.half_width, parameters["theta_j_rad"]

    def arm(q: float, s: int) -> float:
        x = max(-1.0, min(q / limit, 1.0))
        return half * x * (3.0 - x * x) / 2.0

    def contact(q: Any, s: Any) -> tuple[Any, Any]:
        x = np.minimum(q / limit, 1.0)
        return s * half * x * (3.0 - x * x) / 2.0, 0.0 * q

    return Joint(arm, contact, lambda q: 0.0, half)


JOINTS: dict[str, Callable[[Wall, Parameters], Joint]] = {
    "pivot_shift": pivot_shift,
    "winkler": winkler,
    "rounded_edge": rounded_edge,
    "cubic_joint": cubic_joint,
}

"""Which answers count as right for which truth.

Effects that share a row of the table because no sensor tells them apart accept each other. A name
may carry a target (``gain@WP-1``): the part before the ``@`` is compared here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

_SAME_TO_ALL_SENSORS: Final = (
    # A base that leans, a mass off centre and unequal edges turn gravity against the wall alike.
    ("alpha_asymmetry", "base_tilt", "eccentric_mass"),
    ("dwell", "bounce"),
    ("lag", "filter_delay"),
    # What makes a wire's length no straight measure of travel: the world's is an anchor at another height.
    ("wire_cosine", "wire_sag", "wire_anchor"),
)
_OTHER_WORDS: Final[dict[str, tuple[str, ...]]] = {
    "winkler": ("compliant_joint", "semi_rigid_winkler"),
    "restitution_slope": ("restitution_velocity",),
    "flexible_wall": ("flexible_mode",),
    "compliance": ("base_compliance", "rig_compliance"),
    "yaw": ("twist",),
    "sliding": ("sliding_on",),
    "slippery_base": ("sliding",),
    "slippery_edge": ("sliding",),
    "ambient": ("ambient_vibration",),
    "irregular_floor": ("ambient", "ambient_vibration"),
    "drift": ("offset_drift",),
    "clock": ("clock_rate",),
    "swap": ("channel_swap",),
}

COMPARABLE: Final[dict[str, str]] = {
    "pivot_shift": "a",
    "winkler": "theta_c",
    "rounded_edge": "rho",
    "restitution_slope": "k",
    "restitution_asymmetry": "d",
    "viscous": "zeta",
    "coulomb": "mu",
    "alpha_asymmetry": "delta",
    "base_tilt": "beta",
    "eccentric_mass": "e",
    "sliding": "c",
    "corner_twist": "c",
    "dwell": "tau",
    "bounce": "tau",
    "residual_cable": "k",
    "taut_cable": "k",
    "slow_release": "tau",
    "ambient": "amplitude",
    "gain": "error",
    "lag": "tau",
    "slow_response": "tau",
    "filter_delay": "tau",
    "wire_inertia": "frequency",
    "clock": "error",
}
"""Effects whose strength can be compared between the generator and a result, and its name there."""


def comparable(effect: str, label_value: float) -> float:
    """The strength in a label as a result counts it, where the two count differently.

    The world's force of a slow release falls evenly until τ; a result's τ is the mean time of the force,
    whatever its form, and that of an even one is half. The world's clock runs at a rate that is wrong by its
    error; a result's t' = (1 + ε) t (design) is of the time that passes between two samples. The world's wall
    turns about a corner of one edge alone; a result's turn c (cos φ ± sin φ) is that at φ = ±45°.
    """
    match effect:
        case "slow_release":
            return 0.5 * label_value
        case "corner_twist":
            return label_value / math.sqrt(2.0)
        case "clock":
            return 1.0 / (1.0 + label_value) - 1.0
    return label_value


def base_name(name: str) -> str:
    """Name without its target."""
    return name.partition("@")[0]


def accepted_names(truth: str) -> tuple[str, ...]:
    """Answers that are right where `truth` was hidden, the truth first."""
    group = next((g for g in _SAME_TO_ALL_SENSORS if truth in g), (truth,))
    names = [truth, *group]
    for name in tuple(names):
        names += _OTHER_WORDS.get(name, ())
    return tuple(dict.fromkeys(names))


def class_of(names: Iterable[str]) -> tuple[str, ...]:
    """The same for all hypotheses that differ only by effects that no sensor tells apart."""
    return tuple(sorted(_first_of_class(name) for name in names))


def _first_of_class(name: str) -> str:
    effect, at, target = name.partition("@")
    group = next((g for g in _SAME_TO_ALL_SENSORS if effect in g), (effect,))
    return group[0] + at + target


def families_of(text: str) -> tuple[str, ...]:
    """Families of a hypothesis as a result writes them: ``interface`` or ``interface + sensor``."""
    return tuple(part.strip() for part in text.split("+") if part.strip() not in ("", "none"))

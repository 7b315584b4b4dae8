"""Causes as an engineer says them: "the pivot moved inwards by 9.8 ± 0.6 mm", not ``pivot_shift.a``."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from typing import Any, Final

from daq_app.config.families import in_a_sentence
from daq_app.config.wording import signed

_UNITS: Final = {
    "mm": 1e3,
    "ms": 1e3,
    "mrad": 1e3,
    "mrad/s": 1e3,
    "mm/s": 1e3,
    "%": 100.0,
    "Hz": 1.0,
    "m/s²": 1.0,
    "1/m": 1.0,
    "mm per rad/s": 1e3,
    "mrad per rad/s": 1e3,
    "per 100 mrad/s": 0.1,
    "": 1.0,
}
"""What is written → factor from SI."""

_PHRASES: Final = {
    "pivot_shift": "the pivot moved inwards by {a|mm}",
    "winkler": "the joint is compliant: uplift begins at {theta_c|mrad}",
    "rounded_edge": "the edges are rounded to a radius of {rho|mm}",
    "crushing": "the edges are crushed: α falls by {loss|%} in 100 impacts",
    "restitution_wear": "r falls by {loss|%} in 100 impacts",
    "restitution_slope": "r changes with the speed of the impact, by {k|per 100 mrad/s}",
    "restitution_asymmetry": "r differs from side to side by ± {d|}",
    "viscous": "viscous damping of {zeta|%} of critical",
    "coulomb": "dry friction of {mu|%} of the restoring moment",
    "alpha_asymmetry": "α differs from side to side by ± {delta|mrad}",
    "base_tilt": "the base is tilted by {beta|mrad}",
    "eccentric_mass": "the mass is off centre by {e|mm}",
    "dwell": "the wall dwells upright for {tau|ms} after each impact",
    "bounce": "the wall bounces for {tau|ms} at each impact",
    "sliding": "the base slides to and fro at impacts, by {c|mm per rad/s}",
    "sliding_on": "the base slides to one side at impacts, by {c|mm per rad/s}",
    "corner_twist": "the wall turns about a corner at impacts, by {c|mrad per rad/s}",
    "flexible_wall": "the wall rings at {frequency|Hz}",
    "compliance": "rig or base gives way by {phi|mrad} under the full moment",
    "twist": "the wall twists about its vertical at {frequency|Hz}",
    "yaw": "the wall yaws at {frequency|Hz} after impacts",
    "residual_cable": "a cable still pulls on the release side, with {k|} of the restoring stiffness",
    "taut_cable": "a cable stays taut while the wall rocks, with {k|} of the restoring stiffness",
    "initial_velocity": "the wall was let go with {omega|mrad/s}",
    "slow_release": "the release is slow: the force falls over {tau|ms}",
    "ambient": "the floor shakes with {amplitude|m/s²} at {frequency|Hz}",
    "gain": "the scale of {target} is off by {error|%}",
    "lag": "readings of {target} are late by {tau|ms}",
    "slow_response": "slow response of {target}, with a time constant of {tau|ms}",
    "filter_delay": "a filter delays {target} by {tau|ms}",
    "drift": "drift of {target} by {rate|mm/s}",
    "wire_cosine": "the travel of {target} is bent by {kappa|1/m}",
    "wire_anchor": "the anchor of {target} is off in height by {height|mm}",
    "wire_inertia": "spring and drum of {target} swing at {frequency|Hz}",
    "clock": "the sample clock is off by {error|%}",
    "hum": "mains hum in {target}",
    "noise": "{target} is noisier than its family",
    "quantisation": "steps in the readings of {target}",
    "saturation": "{target} at the end of the range",
    "dropout": "readings of {target} stand still at times",
    "polarity": "{target} connected the wrong way round",
    "swap": "exchanged plugs: {target}",
}
"""Effect → words; ``{parameter|unit}``: its value with half of its 95 % interval; ``{target}``: sensors."""

Interval = tuple[float, float, float]
"""(value, low, high) in SI."""


def cause_in_words(effect: str, estimates: Mapping[str, Interval], otherwise: str = "") -> str:
    """One effect of the library in words; `estimates` are by parameter (``a`` or ``pivot_shift.a``).

    A size that is not known is said to be so. An effect without words of its own is said as `otherwise`, or
    keeps its name.
    """
    base, _, target = effect.partition("@")
    phrase = _PHRASES.get(base)
    if phrase is None:
        return otherwise or effect.replace("_", " ")
    phrase = phrase.replace("{target}", in_a_sentence(target) or "a channel")
    for parameter, unit in re.findall(r"\{(\w+)\|([^}]*)\}", phrase):
        estimate = estimates.get(f"{effect}.{parameter}", estimates.get(parameter))
        size = "an unknown amount" if estimate is None else with_interval(*estimate, unit)
        phrase = phrase.replace(f"{{{parameter}|{unit}}}", size)
    return phrase


def causes_in_words(causes: Iterable[Mapping[str, Any]]) -> tuple[str, ...]:
    """The material causes of a result (`causes` of its JSON), each with what it closes alone."""
    sentences = []
    for cause in causes:
        if not cause["material"]:
            continue
        sizes = {e["name"]: (e["value"], e["low"], e["high"]) for e in cause["estimates"]}
        words = cause_in_words(cause["name"], sizes, cause["words"])
        closes = cause["closes"]
        known = closes is not None and math.isfinite(closes)
        sentences.append(f"{words} (closes {100.0 * closes:.0f} % of the gap alone)" if known else words)
    return tuple(sentences)


def gap_goes(before: float, after: float) -> str:
    """What becomes of the gap on held-out runs, in noise and scatter: ``falls from 9.10 to 0.97``."""
    return f"{'rises' if after > before else 'falls'} from {before:.2f} to {after:.2f}"


def closed_share(closure: float) -> str:
    """How much of what could be gained was gained, or closed of a gap: ``97 %``; ``nothing`` of a loss."""
    return f"{100.0 * closure:.0f} %" if closure > 0.0 else "nothing"


def with_interval(value: float, low: float, high: float, unit: str) -> str:
    """A value with half of its 95 % interval, rounded to two digits of it: ``9.8 ± 0.6 mm``."""
    factor = _UNITS[unit]
    value, half = factor * value, factor * (high - low) / 2.0
    space = "" if unit == "" else " "
    if not math.isfinite(half) or half <= 0.0:
        return f"{signed(value, '.3g')}{space}{unit}"
    # Two digits of the half interval where it begins with a 1, else one.
    leading = math.floor(math.log10(half))
    digits = max(0, -leading + (1 if half / 10.0**leading < 2.0 else 0))
    return f"{signed(value, f'.{digits}f')} ± {half:.{digits}f}{space}{unit}"

"""Steps at impacts that stay: how far an effect moves or turns the wall with the speed of each impact."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Final

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.shapes import Term, stepped_shape
from daq_app.gap.rocking_model.motion.rotation import shown_by_wires

_ALTERNATING: Final = {"on": False, "back": True}
"""Form of the steps → whether they change sign with the side that the wall comes from."""


def at_impacts(run: RockingRun, values: Mapping[str, float], key: str) -> float:
    """What an effect does for each rad/s of an impact's approach speed, in the speeds of the survey's wall.

    The grid has these. A block falls from a small rotation φ with ω² = 2 p² φ sin α, so that another p and α
    make all impacts faster by nearly the same share.
    """
    if not (strength := values.get(key, 0.0)):
        return 0.0
    survey = run.survey
    faster = math.sin(values["alpha"]) / math.sin(survey.alpha_rad)
    return strength * values["p"] / survey.p_rad_s * math.sqrt(faster)


def slides(run: RockingRun, values: Mapping[str, float]) -> dict[str, float]:
    """Form → how far the base slides per approach speed, m s/rad; empty for a base that does not."""
    on = at_impacts(run, values, "sliding_on.c") * (1.0 + values.get("sliding_on.own", 0.0))
    return _there("sliding", on, at_impacts(run, values, "sliding.c"))


def turns(run: RockingRun, values: Mapping[str, float]) -> dict[str, float]:
    """Form → how far the wall turns about the vertical per approach speed, s; empty for one that does not."""
    size, alternation = at_impacts(run, values, "corner_twist.c"), values.get("corner_twist.alternation", 0.0)
    return _there("corner_twist", size * math.cos(alternation), size * math.sin(alternation))


def _there(effect: str, on: float, back: float) -> dict[str, float]:
    sizes = {f"{effect}.on": on, f"{effect}.back": back}
    return {form: size for form, size in sizes.items() if size != 0.0}


def stepped(run: RockingRun, form: str) -> FloatArray:
    """What one form adds for a step of 1 per rad/s, (m,); 0 at rest."""
    alternating = _ALTERNATING[form.rpartition(".")[2]]
    make = partial(stepped_shape, run.grid, alternating=alternating)
    return np.asarray(run.cache.constant(("stepped", alternating), make))


def step_terms(run: RockingRun, steps: Mapping[str, float], share: float = 1.0) -> Iterator[Term]:
    """A share of steps, by their forms."""
    for form, size in steps.items():
        yield share * size, form, partial(stepped, run, form)


def turn_share(run: RockingRun, *, of_base: bool) -> float:
    """What a turn of 1 rad makes of the wires' mean rotation (weights z²), rad, or of the base, m."""

    def share() -> float:
        y = np.array([wire.sensor.position_m[1] for wire in run.wires])
        return -shown_by_wires(run.wires, y, of_base=of_base)

    return run.cache.constant(("turn share", of_base), share)

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

_FORMS: Final = {"on": (False, 1), "back": (True, 1), "on squared": (False, 2), "back squared": (True, 2)}
"""Form of the steps → whether they change sign with the side that the wall comes from, and the power of the
speed that they go with."""


def faster(run: RockingRun, values: Mapping[str, float]) -> float:
    """Speed of the wall's impacts over that of the survey's wall, 1, which the grid has.

    A block falls from a small rotation φ with ω² = 2 p² φ sin α, so that another p and α make all impacts
    faster by nearly the same share.
    """
    survey = run.survey
    return values["p"] / survey.p_rad_s * math.sqrt(math.sin(values["alpha"]) / math.sin(survey.alpha_rad))


def slides(run: RockingRun, values: Mapping[str, float]) -> dict[str, float]:
    """Form → how far the base slides per approach speed, m s/rad; empty for a base that does not.

    What goes with the square of the speed is told at 0.2 rad/s.
    """
    on = values.get("sliding_on.c", 0.0) * (1.0 + values.get("sliding_on.own", 0.0))
    return {
        **_slid(run, values, "on", on, values.get("sliding_on.square", 0.0)),
        **_slid(run, values, "back", values.get("sliding.c", 0.0), values.get("sliding.square", 0.0)),
    }


def _slid(
    run: RockingRun, values: Mapping[str, float], form: str, strength: float, square: float
) -> dict[str, float]:
    if not strength:
        return {}
    speed = faster(run, values)
    sizes = {form: (1.0 - square) * strength * speed, f"{form} squared": square * strength * speed**2}
    return {f"sliding.{form}": size for form, size in sizes.items() if size != 0.0}


def turns(run: RockingRun, values: Mapping[str, float]) -> dict[str, float]:
    """Form → how far the wall turns about the vertical per approach speed, s; empty for one that does not."""
    if not (strength := values.get("corner_twist.c", 0.0)):
        return {}
    size, alternation = strength * faster(run, values), values.get("corner_twist.alternation", 0.0)
    sizes = {
        "corner_twist.on": size * math.cos(alternation),
        "corner_twist.back": size * math.sin(alternation),
    }
    return {form: size for form, size in sizes.items() if size != 0.0}


def stepped(run: RockingRun, form: str) -> FloatArray:
    """What one form adds for a step of 1 per rad/s, (m,); 0 at rest."""
    alternating, power = _FORMS[form.rpartition(".")[2]]
    make = partial(stepped_shape, run.grid, alternating=alternating, power=power)
    return np.asarray(run.cache.constant(("stepped", alternating, power), make))


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

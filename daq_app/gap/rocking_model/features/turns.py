"""A wall that turns about its corners at impacts, and stays turned, as wires along its length show it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.differences import Term, at_impacts
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.shapes import turned_shape
from daq_app.gap.rocking_model.motion.rotation import shown_by_wires

_FORMS = {"corner_twist.on": False, "corner_twist.back": True}
"""Form of the turns → whether they change sign with the side."""


def turns(run: RockingRun, values: Mapping[str, float]) -> dict[str, float]:
    """Form → how much of it there is, s; empty for a wall that does not turn."""
    size, alternation = at_impacts(run, values, "corner_twist.c"), values.get("corner_twist.alternation", 0.0)
    sizes = (size * math.cos(alternation), size * math.sin(alternation))
    return {form: part for form, part in zip(_FORMS, sizes, strict=True) if part != 0.0}


def turned(run: RockingRun, form: str) -> FloatArray:
    """Rotation about the vertical of one form for a turn of 1 rad per rad/s, (m,), rad; 0 at rest."""
    return np.asarray(
        run.cache.constant(("turned", form), lambda: turned_shape(run.grid, alternating=_FORMS[form]))
    )


def turn_share(run: RockingRun, *, of_base: bool) -> float:
    """What a turn of 1 rad makes of the wires' mean rotation (weights z²), rad, or of the base, m."""

    def share() -> float:
        y = np.array([wire.sensor.position_m[1] for wire in run.wires])
        return -shown_by_wires(run.wires, y, of_base=of_base)

    return run.cache.constant(("turn share", of_base), share)


def turn_terms(run: RockingRun, values: Mapping[str, float], share: float = 1.0) -> Iterator[Term]:
    """A share of the rotation about the vertical, by its forms."""
    for form, size in turns(run, values).items():
        yield share * size, form, partial(turned, run, form)

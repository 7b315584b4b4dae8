"""How far LVDTs are from straight: what the face that opens adds to the rotation, beside its gain."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Final

import numpy as np

from daq_app.gap.core import Parameter
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.sensors import LVDT_STRAIGHT

_FORMS: Final[dict[str, Callable[[FloatArray], FloatArray]]] = {
    "square": lambda x: np.asarray(1.5 * x**2),
    "cube": lambda x: np.asarray(2.5 * x**3 - 1.5 * x),
}
"""Legendre's polynomials over the range, −1 to 1, less constants: no straight line has a part in them."""


def straightness(faces: Mapping[str, str]) -> tuple[Parameter, ...]:
    """The parameters of faces, of the mean of twelve LVDTs each; `faces` say in words where each is."""
    return tuple(
        Parameter(
            f"{face}_{form}",
            0.0,
            LVDT_STRAIGHT / math.sqrt(12),
            "1",
            meaning=f"{form} of the LVDTs' readings at {where} over their range",
        )
        for face, where in faces.items()
        for form in _FORMS
    )


def lvdt_range(run: GapRun) -> tuple[float, float]:
    """Range of the LVDTs, m, in the median; NaN where none has one."""
    ranges = [run.sensors[place].range_si for place in run.indices("lvdt")]
    known = [each for each in ranges if np.all(np.isfinite(each))]
    low, high = np.median(known, axis=0).tolist() if known else (math.nan, math.nan)
    return low, high


def not_straight(
    run: RockingRun, values: Mapping[str, float], theta: FloatArray, name: str
) -> FloatArray | float:
    """What LVDTs that are not straight add to rotations `theta`, rad, of any shape, that are read from them.

    `name` is that of these rotations, which are always the same ones in a run.
    """
    if run.reference != "lvdt" or not np.isfinite(run.lvdt_range_m[1]):
        return 0.0
    added: FloatArray = np.zeros_like(theta)
    for form in _FORMS:
        first, second = values[f"face_a_{form}"], values[f"face_b_{form}"]
        if first != 0.0 or second != 0.0:
            shape = run.cache.constant(("straight", form, name), partial(_shape, run, form, theta))
            # The face that opens is the one that measures: x < 0 for a positive rotation.
            added += np.where(theta > 0.0, first, second) * shape
    return added


def _shape(run: RockingRun, form: str, theta: FloatArray) -> FloatArray:
    """What one per half of the range of a form adds to rotations, rad; of the shape of `theta`."""
    low, high = run.lvdt_range_m
    half, middle = 0.5 * (high - low), 0.5 * (high + low)
    opened = 2.0 * run.survey.half_base_m * np.abs(theta)
    of = _FORMS[form]
    shape = of((opened - middle) / half) - of(np.array(-middle / half))
    return np.asarray(np.sign(theta) * half * shape / (2.0 * run.survey.half_base_m))

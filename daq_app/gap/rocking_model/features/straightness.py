"""How far LVDTs are from straight: what the face that opens adds to the rotation, beside its gain.

How far a single one is shows in what those of one face differ by; the mean of a face is off by that over the
root of their number.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from daq_app.gap.core import Parameter
from daq_app.gap.core.features import FloatArray, robust_sd
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.motion.rotation import gridded
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.sensors import LVDT_STRAIGHT, STRAIGHTEST_LVDT

_FORMS: Final[dict[str, Callable[[FloatArray], FloatArray]]] = {
    "square": lambda x: np.asarray(1.5 * x**2),
    "cube": lambda x: np.asarray(2.5 * x**3 - 1.5 * x),
}
"""Legendre's polynomials over the range, −1 to 1, less constants: no straight line has a part in them."""
_FEWEST: Final = 4
"""LVDTs of a face whose differences say how straight one of them is."""
_SHORTEST: Final = 100
"""Readings of the grid at which a face is open."""


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


def _range(run: GapRun) -> tuple[float, float]:
    """Range of the LVDTs, m, in the median; NaN where none has one."""
    ranges = [run.sensors[place].range_si for place in run.indices("lvdt")]
    known = [each for each in ranges if np.all(np.isfinite(each))]
    low, high = np.median(known, axis=0).tolist() if known else (math.nan, math.nan)
    return low, high


def _differ_by(run: GapRun, theta: FloatArray, ends_m: tuple[float, float]) -> float:
    """Sd of what an LVDT differs by from its face in each form, over half of the range; NaN for too few.

    `theta` (m,), rad, is the rotation on the grid.
    """
    half, middle = 0.5 * (ends_m[1] - ends_m[0]), 0.5 * (ends_m[1] + ends_m[0])
    sizes: list[float] = []
    for side in (-1.0, 1.0):
        places = [
            i for i in run.indices("lvdt") if side * run.sensors[i].position_m[0] > 0.0 and run.reads(i)
        ]
        opens = side * theta < 0.0
        if len(places) < _FEWEST or opens.sum() < _SHORTEST:
            continue
        signals = np.array([gridded(run, place)[opens] for place in places])
        face = np.median(signals, axis=0)
        shapes = [form((face - middle) / half) for form in _FORMS.values()]
        design = np.column_stack([*shapes, face, np.ones_like(face)])
        found = np.linalg.lstsq(design, (signals - face).T, rcond=None)[0][: len(shapes)]
        sizes += (found / half).ravel().tolist()
    return float(robust_sd(np.array(sizes))) if sizes else math.nan


def equally_straight(runs: Sequence[RockingRun], recorded: Sequence[GapRun]) -> list[RockingRun]:
    """The runs of a campaign, whose LVDTs are in all as straight as its largest release shows them.

    `recorded` are the runs that these were examined from, in the same order.
    """
    largest = max(range(len(runs)), key=lambda k: abs(runs[k].swings.peak_rad[0]))
    ends_m = _range(recorded[largest])
    if math.isnan(ends_m[0]):
        return list(runs)
    seen = _differ_by(recorded[largest], runs[largest].grid.theta, ends_m)
    size = LVDT_STRAIGHT if math.isnan(seen) else max(seen, STRAIGHTEST_LVDT)
    return [replace(run, lvdt_range_m=ends_m, lvdt_curves=size) for run in runs]


def not_straight(
    run: RockingRun, values: Mapping[str, float], theta: FloatArray, name: str
) -> FloatArray | float:
    """What LVDTs that are not straight add to rotations `theta`, rad, of any shape, that are read from them.

    `name` is that of these rotations, which are always the same ones in a run.
    """
    if run.reference != "lvdt" or math.isnan(run.lvdt_curves):
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
    """What a form that is one over half of the range adds to rotations, rad; of the shape of `theta`.

    Where LVDTs are straighter than the table says, a parameter of one stands for as much less.
    """
    low, high = run.lvdt_range_m
    half, middle = 0.5 * (high - low), 0.5 * (high + low)
    opened = 2.0 * run.survey.half_base_m * np.abs(theta)
    of = _FORMS[form]
    shape = of((opened - middle) / half) - of(np.array(-middle / half))
    size = half * run.lvdt_curves / LVDT_STRAIGHT
    return np.asarray(np.sign(theta) * size * shape / (2.0 * run.survey.half_base_m))

"""What wires show besides the wall's rotation, where they are the reference: slips, bending, play, crosstalk.

The motion is read from them where the LVDTs are late or go in steps, and then every peak and every crossing
carries it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.polynomial import Polynomial

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.differences import at_impacts
from daq_app.gap.rocking_model.features.family import CROSSTALK_SHARE
from daq_app.gap.rocking_model.features.oscillations.ring_response import bent_form, bent_share, bent_wall
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.shapes import play_shape, slip_shape
from daq_app.gap.rocking_model.features.turns import turn_share, turned, turns
from daq_app.gap.rocking_model.motion.swings import TOP_DEGREE


@dataclass(frozen=True, slots=True)
class _Carried:
    """What 1 rad of one form adds to the peaks (n,), rad, and to the time features (T,), s."""

    peaks: FloatArray
    times: FloatArray


def peaks_carry(run: RockingRun, values: Mapping[str, float]) -> FloatArray | float:
    """What the peaks of the reference have beyond those of the wall, (n,), rad."""
    carried_rad: FloatArray | float = 0.0
    for size, carried in _forms(run, values):
        carried_rad = carried_rad + size * carried.peaks
    return carried_rad


def times_carry(run: RockingRun, values: Mapping[str, float]) -> FloatArray | float:
    """By how much the time features of the reference are longer than those of the wall, (T,), s.

    Beside what the peaks carry already, by which the levels of a half-cycle are moved.
    """
    carried_s: FloatArray | float = 0.0
    for size, carried in _forms(run, values):
        carried_s = carried_s + size * carried.times
    return carried_s


def _forms(run: RockingRun, values: Mapping[str, float]) -> Iterator[tuple[float, _Carried]]:
    if run.reference != "wire":
        return
    if play := values["wire_play"]:
        yield play, _carried(run, "play")
    if share := values.get(CROSSTALK_SHARE, 0.0):
        yield share, _carried(run, "crosstalk")
    if slip := at_impacts(run, values, "sliding.c"):
        yield slip / run.wire_height_m, _carried(run, "slip")
    for form, size in turns(run, values).items():
        yield size * turn_share(run, of_base=False), _carried(run, form)
    for form, size in bent_wall(run, values).items():
        yield size * bent_share(run, of_base=False), _carried(run, form)


def _carried(run: RockingRun, form: str) -> _Carried:
    return run.cache.constant(("carried", form), partial(_work_out, run, form))


def _work_out(run: RockingRun, form: str) -> _Carried:
    swings, grid = run.swings, run.grid
    match form:
        case "crosstalk":
            series = run.leaked
        case "play":
            series = play_shape(grid.theta)
        case "slip":
            series = slip_shape(grid)
        case "corner_twist.on" | "corner_twist.back":
            series = turned(run, form)
        case _:
            series = bent_form(run, form)
    crossings = np.hstack([swings.fall_s, swings.rise_s])
    peaks = np.interp(swings.peak_s, grid.time_s, series)
    for k, (begin, end) in enumerate(zip(swings.rise_s[:, 0], swings.fall_s[:, 0], strict=True)):
        over = (grid.time_s >= begin) & (grid.time_s <= end)
        if np.count_nonzero(over) > 2 * TOP_DEGREE:
            # What a peak is read from is a polynomial over its top, which follows no ringing.
            top = Polynomial.fit(grid.time_s[over], series[over], TOP_DEGREE)
            peaks[k] = top(swings.peak_s[k])
    beyond = np.interp(crossings, grid.time_s, series) - peaks[:, None]
    speeds = np.interp(crossings, grid.time_s, grid.omega)
    late = -beyond / np.where(speeds == 0.0, np.inf, speeds)
    first, a, second, b = run.places.T
    return _Carried(peaks, late[second, b] - late[first, a])

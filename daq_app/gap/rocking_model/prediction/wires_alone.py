"""What wires show besides the wall's rotation, where they are the reference: slips, bending, play, crosstalk,
and how they settle after impacts.

The motion is read from them where the LVDTs are late or go in steps, and then every peak and every crossing
carries it. Those of LVDTs carry the recoil of a wall that rings.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.polynomial import Polynomial

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.family import CROSSTALK_SHARE
from daq_app.gap.rocking_model.features.oscillations.ring_response import (
    bent_form,
    bent_share,
    bent_wall,
    recoil,
)
from daq_app.gap.rocking_model.features.response import delay
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.shapes import play_shape
from daq_app.gap.rocking_model.features.slips.impact_steps import slides, stepped, turn_share, turns
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
    carried_s: FloatArray | float = _settling(run, values)
    for size, carried in _forms(run, values):
        carried_s = carried_s + size * carried.times
    return carried_s


def _settling(run: RockingRun, values: Mapping[str, float]) -> FloatArray | float:
    """What the time features, (T,), s, have of wires that still settle after an impact.

    At an impact the speed jumps and the restoring changes its sign. Afterwards a response comes down to the
    delayed and rounded rotation, which is in the peaks and levels, from what it lacks of it at the impact.
    """
    if run.reference != "wire" or not run.grid.impact_s.size:
        return 0.0
    responses = list(_responses(values))
    if not responses:
        return 0.0
    swings, grid = run.swings, run.grid
    # What comes late as a whole shows impacts and crossings alike late.
    late_s = delay("wire", values) - values.get("lag@wire.tau", 0.0)
    begin = np.fmin.reduce(swings.rise_s, axis=1)
    place = np.maximum(np.searchsorted(grid.impact_s, np.nan_to_num(begin)) - 1, 0)
    since = np.maximum(swings.rise_s - grid.impact_s[place, None] + late_s, 0.0)
    jump = grid.jumps[place, None]
    turn = -2.0 * np.sign(grid.approach[place, None]) * values["p"] ** 2 * math.sin(values["alpha"])
    left = np.sum([response(since, jump, turn) for response in responses], axis=0)
    left[0] = 0.0
    return _longer(run, np.hstack([np.zeros_like(swings.fall_s), left]))


def _longer(run: RockingRun, beyond: FloatArray) -> FloatArray:
    """How much longer time features are, (T,), s, for crossings that show so much more, (n, 2F), rad."""
    crossings = np.hstack([run.swings.fall_s, run.swings.rise_s])
    speeds = np.interp(crossings, run.grid.time_s, run.grid.omega)
    late = -beyond / np.where(speeds == 0.0, np.inf, speeds)
    first, a, second, b = run.places.T
    return np.asarray(late[second, b] - late[first, a])


_AT_ONCE_S = 1e-4
_Settles = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""(time since the impact in s, jump of the speed, jump of the acceleration) → what is left, in rad."""


def _responses(values: Mapping[str, float]) -> Iterator[_Settles]:
    """How each response of the wires settles that is not over at once."""
    if (slow := values.get("slow_response@wire.tau", 0.0)) > _AT_ONCE_S:
        yield lambda since, jump, turn: (jump * slow - turn * slow**2) * np.exp(-since / slow)
    if (tau := values.get("filter_delay@wire.tau", 0.0)) > _AT_ONCE_S:
        yield partial(_swinging, math.sqrt(3.0) / tau, math.sqrt(3.0) / 2.0)
    if frequency := values.get("wire_inertia@wire.frequency", 0.0):
        yield partial(_swinging, 2.0 * math.pi * frequency, values.get("wire_inertia@wire.zeta", 0.2))


def _swinging(
    natural: float, zeta: float, since: FloatArray, jump: FloatArray, turn: FloatArray
) -> FloatArray:
    """What is left of a resonator, rad, (…): it starts at rest where its delayed and rounded input does not.

    `natural`: ω, rad/s. The input jump · t + ½ turn · t² is followed by jump (t − d) + turn (½ t² − d t + c).
    """
    late, rounded = 2.0 * zeta / natural, (4.0 * zeta**2 - 1.0) / natural**2
    begin, speed = jump * late - turn * rounded, turn * late - jump
    damped = natural * math.sqrt(max(1.0 - zeta**2, 1e-6))
    phase = damped * since
    swung = begin * np.cos(phase) + (speed + zeta * natural * begin) / damped * np.sin(phase)
    return np.asarray(np.exp(-zeta * natural * since) * swung)


def _forms(run: RockingRun, values: Mapping[str, float]) -> Iterator[tuple[float, _Carried]]:
    share = bent_share(run, of_base=False) if run.reference == "wire" else 0.0
    for form, size in bent_wall(run, values).items():
        yield size * (share + recoil(run, values)), _carried(run, form)
    if run.reference != "wire":
        return
    if play := values["wire_play"]:
        yield play, _carried(run, "play")
    if share := values.get(CROSSTALK_SHARE, 0.0):
        yield share, _carried(run, "crosstalk")
    for form, size in slides(run, values).items():
        yield size / run.wire_height_m, _carried(run, form)
    for form, size in turns(run, values).items():
        yield size * turn_share(run, of_base=False), _carried(run, form)


def _carried(run: RockingRun, form: str) -> _Carried:
    return run.cache.constant(("carried", form), partial(_work_out, run, form))


def _work_out(run: RockingRun, form: str) -> _Carried:
    swings, grid = run.swings, run.grid
    match form:
        case "crosstalk":
            series = run.leaked
        case "play":
            series = play_shape(grid.theta)
        case _ if form.startswith(("sliding.", "corner_twist.")):
            series = stepped(run, form)
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
    return _Carried(peaks, _longer(run, beyond))

"""What a base that slips does to the motion: the slip is measured, and its effect is known to a share.

In the frame of a slipping edge the block is one whose floor moves (Housner 1963): θ̈ = −p² (sin(α − θ) +
ẍ/g cos(α − θ)). Between impacts that makes half-cycles shorter, and at impacts, where the slip stops, slower.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from daq_app.config.rig import G_M_S2
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.prediction.model import half_cycle_times, peak_slopes
from daq_app.gap.rocking_model.tolerances.walls import SLIP_LEFT_OPEN, SLIP_TO_FIRST_ORDER
from daq_app.rocking.families.base.slip import BaseSlip
from daq_app.rocking.theory.friction import Slips, slips_below
from sim_hardware.dynamics import shooting

_MOST_TAKEN: Final = 0.9
"""Share of its speed that a slip takes from a wall at most: to first order it could be all of it."""


def on_its_base(run: RockingRun) -> RockingRun:
    """The run as on a base that does not slip: its features less what the slip does to the motion."""
    if run.slip is None:
        return run
    moved = slip_effects(run, run.slip)
    features = replace(
        run.features,
        values=run.features.values - moved.sum(axis=1),
        sd=np.hypot(run.features.sd, SLIP_TO_FIRST_ORDER * np.abs(moved).max(axis=1)),
    )
    return replace(run, features=features).with_loadings(SLIP_LEFT_OPEN * moved)


def slip_effects(run: RockingRun, slip: BaseSlip) -> FloatArray:
    """What the base moves the features of a run by, (n, 2): between impacts, and at them.

    By the law of friction. An impact stops the edge that the wall leaves, and may set off the other one.
    """
    peaks = np.abs(run.swings.peak_rad)
    alpha, p = run.survey.alpha_rad, run.survey.p_rad_s
    speeds = p * np.sqrt(2.0 * (np.cos(alpha - peaks) - math.cos(alpha)))
    begin = slip.begins_s2 * np.append(0.0, speeds[:-1])
    slips = slips_below(slip.below_rad, peaks, alpha, p, begin)
    along = np.where(run.swings.peak_rad < 0.0, slip.along[0], slip.along[1])
    table = _moved(run, slips, along)
    k = run.peaks
    slopes = peak_slopes(run)
    count, last = len(run.places), len(run.places) + k.size
    moved = np.zeros((len(run.features), 2))
    moved[:count, 0] = half_cycle_times(run, table)
    jumps = p**2 / G_M_S2 * math.cos(alpha) * ((along * slips.end)[k - 1] + (along * begin)[k])
    # In proportion to the speed that the wall has: jumps are as large as the speeds of the last half-cycles.
    before, after = table[k - 1, shooting.SPEED_OUT] / speeds[k - 1], table[k, shooting.SPEED_IN] / speeds[k]
    before, after = (np.maximum(share, -_MOST_TAKEN) for share in (before, after))
    moved[count:last, 0] = (np.log1p(before) - np.log1p(after)) / slopes
    moved[count:last, 1] = -np.log1p(jumps / speeds[k]) / slopes
    return moved


def _moved(run: RockingRun, slips: Slips, along: FloatArray) -> FloatArray:
    """What slips add to the table of half-cycles, (n, 5 + 2F), to first order, for peaks as measured.

    `along` (n,): accelerations of each half-cycle's edge, m/s² per rad.
    """
    survey, count = run.survey, run.swings.levels.shape[1]
    forced = -(survey.p_rad_s**2) / G_M_S2 * math.cos(survey.alpha_rad) * along * slips.acceleration
    middle = slips.time_s.shape[0] // 2
    table = np.zeros((along.size, shooting.FIRST_CROSSING + 2 * count))
    falls = _pushed(run, slips.time_s[middle:], forced[middle:])
    # From the peak backwards the rise is a fall in which the slip comes in the other order.
    rises = _pushed(run, -slips.time_s[middle::-1], forced[middle::-1])
    ways = ((falls, shooting.FALL_S, shooting.SPEED_OUT), (rises, shooting.RISE_S, shooting.SPEED_IN))
    for place, ((later_s, faster), time, speed) in enumerate(ways):
        first = shooting.FIRST_CROSSING + place * count
        table[:, first : first + count], table[:, time] = later_s[:, :-1], later_s[:, -1]
        table[:, speed] = faster
    return table


def _pushed(run: RockingRun, time_s: FloatArray, forced: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How much later the levels and upright are passed, (n, F + 1), s, and how much faster upright, (n,).

    By the deviation δ̈ = p² δ + forced that begins at the peak; `time_s` and `forced` (steps, n).
    """
    alpha, p = run.survey.alpha_rad, run.survey.p_rad_s
    peaks = np.abs(run.swings.peak_rad)
    levels = np.column_stack([run.swings.levels, np.zeros(peaks.size)])
    at_s = np.arccosh((alpha - levels) / (alpha - peaks)[:, None]) / p
    steps = np.diff(time_s, axis=0)

    def integral(weighted: FloatArray) -> FloatArray:
        parts = 0.5 * (weighted[1:] + weighted[:-1]) * steps
        summed = np.vstack([np.zeros(peaks.size), np.cumsum(parts, axis=0)])
        rows = zip(at_s, time_s.T, summed.T, strict=True)
        return np.array([np.interp(at, time, values) for at, time, values in rows])

    cosine, sine = integral(forced * np.cosh(p * time_s)), integral(forced * np.sinh(p * time_s))
    off = (np.sinh(p * at_s) * cosine - np.cosh(p * at_s) * sine) / p
    rate = np.cosh(p * at_s) * cosine - np.sinh(p * at_s) * sine
    later_s: FloatArray = off / ((alpha - peaks)[:, None] * p * np.sinh(p * at_s))
    return later_s, p**2 * alpha * later_s[:, -1] - rate[:, -1]

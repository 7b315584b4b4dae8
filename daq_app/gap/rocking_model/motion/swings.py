"""Release, peaks and crossing times of one run, each with its measurement error."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt

from daq_app.gap.core import CannotDiagnose
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.motion.held_state import HeldState, held_state
from daq_app.gap.rocking_model.motion.release import release_sample
from daq_app.gap.rocking_model.motion.rotation import HOLD_S
from daq_app.gap.rocking_model.tolerances.motion import (
    AT_REST_RAD,
    SHORTEST_HALF_CYCLE_S,
    SMALLEST_RAD,
    WITHIN_SWAY,
)
from sim_hardware.dynamics.parameters import REST_AMPLITUDE_RAD

FRACTIONS = (0.85, 0.5, 0.15)
"""Rotations at which half-cycles are timed, as shares of the peak."""
RELEASE_FRACTIONS = (0.99, 0.96, 0.85, 0.5, 0.15)
"""The same for the quarter-cycle after the release, which is watched closer at its start."""
TOP_DEGREE = 4
"""Degree of the polynomial over the top of a half-cycle from which its peak is read …"""
_TOP = 0.85
"""… and the share of the peak from which on it is the top."""
MOST = 30
_LAST = 9
"""Peaks from which the fall from one to the next is taken, where it no longer depends on the amplitude."""
_SMOOTH_HZ = 30.0
_WINDOW_S = 0.015


@dataclass(frozen=True, slots=True)
class Swings:
    """Half-cycles of a run; the first is the quarter-cycle from the release.

    `release_s`: s from the start of the record. `peak_s`, `peak_rad`, `peak_sd`: shape (n,), times
    from the release; row 0 is the held rotation, whose error is an unknown of the fit itself.
    `fall_s`, `rise_s` and their `…_sd`: times from the release at which |θ| crosses the levels,
    shape (n, F), NaN where it could not be timed.
    `levels`: shape (n, F), rad.
    """

    release_s: float
    peak_s: FloatArray
    peak_rad: FloatArray
    peak_sd: FloatArray
    levels: FloatArray
    fall_s: FloatArray
    fall_sd: FloatArray
    rise_s: FloatArray
    rise_sd: FloatArray
    rest_s: float
    held: HeldState
    """The wall at the release; its rotation is that of row 0."""

    @property
    def impacts(self) -> float:
        """Impacts of the run until the wall rests by the simulator's criterion.

        Those too small to be timed are as many as it takes to come to rest in the ratio of the last peaks:
        what wears counts them too, and from 2 mrad down to rest they are half of all.
        """
        last = np.log(np.abs(self.peak_rad[-_LAST:]))
        fall = max(float(last[0] - last[-1]) / (last.size - 1), 1e-3)
        return self.peak_rad.size - 1 + max(float(last[-1]) - math.log(REST_AMPLITUDE_RAD), 0.0) / fall


def find_swings(theta: FloatArray, noise_rad: float, p_rad_s: float, rate_hz: float, name: str) -> Swings:
    """Locate everything in a rotation record (n,), rad, of a wall with about this frequency parameter.

    Raises `CannotDiagnose` if nothing rocks.
    """
    smooth = sosfiltfilt(butter(4, _SMOOTH_HZ, fs=rate_hz, output="sos"), theta)
    held = float(np.mean(theta[: int(HOLD_S * rate_hz)]))
    if abs(held) < max(SMALLEST_RAD, 20 * noise_rad / np.sqrt(HOLD_S * rate_hz)):
        raise CannotDiagnose(
            f"Run {name}: the wall is not held at a rotation at the start ({1e3 * held:.2f} mrad).",
            "A record must begin with the wall pulled and held.",
        )
    crossings = np.flatnonzero(np.diff(np.sign(smooth)) != 0)
    crossings = crossings[
        np.abs(smooth[np.clip(crossings + int(0.02 * rate_hz), 0, theta.size - 1)]) > 3 * noise_rad
    ]
    if crossings.size < 3:
        raise CannotDiagnose(
            f"Run {name}: the wall never rocks.", "Check that it was released in this record."
        )
    release = release_sample(smooth, noise_rad, int(crossings[0]), p_rad_s, rate_hz)
    state = held_state(theta, release, noise_rad, rate_hz)
    peaks = _peaks(theta, smooth, crossings, noise_rad, rate_hz)
    if len(peaks) < 3:
        raise CannotDiagnose(
            f"Run {name}: only {len(peaks)} half-cycles are larger than {1e3 * SMALLEST_RAD:.0f} mrad.",
            "Release it from a larger rotation.",
        )
    offset = release / rate_hz
    values = np.array([state.rotation_rad, *(p[1] for p in peaks)])
    levels = np.abs(values)[:, None] * np.array(
        [*FRACTIONS, *[FRACTIONS[-1]] * (len(RELEASE_FRACTIONS) - len(FRACTIONS))]
    )
    levels[0] = abs(state.rotation_rad) * np.array(RELEASE_FRACTIONS)
    samples = [int(release), *(p[3] for p in peaks)]
    fall, fall_sd, rise, rise_sd = _level_times(
        theta, smooth, samples, values, levels, state.rotation_sd, noise_rad, rate_hz
    )
    return Swings(
        release_s=offset,
        peak_s=np.array([offset, *(p[0] for p in peaks)]) - offset,
        peak_rad=values,
        peak_sd=np.array([0.0, *(p[2] for p in peaks)]),
        levels=levels,
        fall_s=fall - offset,
        fall_sd=fall_sd,
        rise_s=rise - offset,
        rise_sd=rise_sd,
        rest_s=float(np.flatnonzero(np.abs(smooth) > max(5 * noise_rad, AT_REST_RAD))[-1]) / rate_hz,
        held=state,
    )


def _level_times(
    theta: FloatArray,
    smooth: FloatArray,
    samples: Sequence[int],
    peaks: FloatArray,
    levels: FloatArray,
    held_sd: float,
    noise: float,
    rate_hz: float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """(fall, its sd, rise, its sd), s in the record, of every peak (n,) through its levels (n, F)."""
    fall, fall_sd, rise, rise_sd = (np.full(levels.shape, np.nan) for _ in range(4))
    after = [*samples[1:], min(samples[-1] + int(1.0 * rate_hz), theta.size - 1)]
    for k, value in enumerate(peaks):
        folded, near = np.sign(value) * theta, np.sign(value) * smooth
        for j in range(levels.shape[1] if k == 0 else len(FRACTIONS)):
            if k == 0 and RELEASE_FRACTIONS[j] > 1.0 - WITHIN_SWAY * held_sd / abs(value):
                continue  # the sway alone may keep the wall below this level
            level, begin = levels[k, j], samples[k]
            fall[k, j], fall_sd[k, j] = _crossing(folded, near, level, begin, after[k], noise, rate_hz)
            if k > 0:
                before = samples[k - 1]
                rise[k, j], rise_sd[k, j] = _crossing(folded, near, level, begin, before, noise, rate_hz)
    return fall, fall_sd, rise, rise_sd


def _peaks(
    theta: FloatArray, smooth: FloatArray, crossings: np.ndarray, noise: float, rate_hz: float
) -> list[tuple[float, float, float, int]]:
    """(time in s, signed peak, its sd, sample) of each half-cycle after the first impact."""
    peaks = []
    for start, stop in itertools.pairwise(crossings):
        part = smooth[start:stop]
        if part.size < SHORTEST_HALF_CYCLE_S * rate_hz:
            continue
        at = int(start) + int(np.argmax(np.abs(part)))
        side = np.sign(smooth[at])
        size = abs(float(smooth[at]))
        if size < max(SMALLEST_RAD, 15 * noise):
            break
        inside = np.flatnonzero(side * part > _TOP * size) + int(start)
        inside = np.arange(inside[0], inside[-1] + 1)
        t = (inside - at) / rate_hz
        scale = max(float(np.abs(t).max()), 1e-6)
        design = np.vander(t / scale, TOP_DEGREE + 1, increasing=True)
        coefficients, *_ = np.linalg.lstsq(design, side * theta[inside], rcond=None)
        slope = np.polynomial.Polynomial(coefficients).deriv()
        roots = [float(r.real) for r in slope.roots() if abs(r.imag) < 1e-9 and abs(r.real) < 0.7]
        top = min(roots, key=abs, default=0.0)
        row = np.vander([top], TOP_DEGREE + 1, increasing=True)[0]
        covariance = np.linalg.inv(design.T @ design)
        sd = noise * float(np.sqrt(row @ covariance @ row))
        peaks.append((at / rate_hz + top * scale, side * float(row @ coefficients), sd, at))
        if len(peaks) >= MOST:
            break
    return peaks


def _crossing(
    folded: FloatArray, smooth: FloatArray, level: float, begin: int, end: int, noise: float, rate_hz: float
) -> tuple[float, float]:
    """(time in s, sd) at which the folded rotation passes `level` between samples `begin` and `end`.

    A parabola is fitted over a short window that does not reach the impact.
    """
    step = 1 if end > begin else -1
    below = np.flatnonzero(smooth[begin:end:step] < level)
    if below.size == 0:
        return np.nan, np.nan
    at = begin + step * int(below[0])
    zero = np.flatnonzero(smooth[at:end:step] <= 0)
    to_zero = int(zero[0]) if zero.size else int(0.05 * rate_hz)
    half = int(max(min(_WINDOW_S * rate_hz, 0.7 * to_zero), 6))
    window = np.arange(at - half, at + half + 1)
    if window[0] < 0 or window[-1] >= folded.size:
        return np.nan, np.nan
    t = (window - at) / rate_hz
    design = np.vander(t, 3, increasing=True)
    coefficients, *_ = np.linalg.lstsq(design, folded[window] - level, rcond=None)
    shift = -coefficients[0] / coefficients[1]
    for _ in range(3):
        slope = coefficients[1] + 2 * coefficients[2] * shift
        shift -= (coefficients[0] + coefficients[1] * shift + coefficients[2] * shift**2) / slope
    if abs(shift) > half / rate_hz:
        return np.nan, np.nan
    row = np.array([1.0, shift, shift**2])
    sd = noise * float(np.sqrt(row @ np.linalg.inv(design.T @ design) @ row)) / abs(float(slope))
    return at / rate_hz + float(shift), sd

"""The reference motion of one run on a coarse grid, with its derivatives and its impacts."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.chebyshev import Chebyshev, chebvander
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.motion.rotation import coarse
from daq_app.gap.rocking_model.motion.swings import Swings
from daq_app.gap.rocking_model.records import Survey
from daq_app.gap.rocking_model.tolerances.motion import AS_FROM_REST, SMALLEST_GRID_RAD

SMOOTH_HZ = 30.0
POLYNOMIAL_DEGREE = 8
MASK_S = 0.05
"""Accelerations near an impact are left out."""
SETTLING_S = 0.02
"""After an impact: a base that gives way follows the reaction to its other edge within some milliseconds."""
_END_OF_FALL_S = (0.1, 0.02)
"""Before an impact: where the speed of the fall is read."""
_FALLS = 4
"""Falls that are compared: the first one and those after it."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Reference motion on the coarse grid, shape (m,): s from release, rad, rad/s, rad/s²."""

    time_s: FloatArray
    theta: FloatArray
    omega: FloatArray
    alpha: FloatArray
    from_impact_s: FloatArray
    """Time to the nearest impact, before or after it; infinite without any."""
    valid: NDArray[np.bool_]
    impact_s: FloatArray
    """Impacts as the reference rotation has them, s from release, up to where half-cycles can be told."""
    raw: FloatArray
    """The reference rotation as measured, averaged over the grid's intervals."""
    rest_s: float
    """When the wall comes to rest, s from release."""
    speed: FloatArray
    """θ̇ at every sample of the record, shape (n,): what jumps at impacts must not be averaged over them."""
    jumps: FloatArray
    """Jump of θ̇ at each impact, rad/s."""
    approach: FloatArray
    """θ̇ just before each impact, rad/s."""

    slips: NDArray[np.bool_]
    """Where the edge that the wall stands on slips; nowhere as long as no slip is known."""

    @property
    def near_impact(self) -> NDArray[np.bool_]:
        """Where an impact, or an edge that slips and bounces, spoils accelerations, (m,)."""
        return np.asarray((self.from_impact_s < MASK_S) | self.slips)

    @property
    def settled(self) -> NDArray[np.bool_]:
        """Where a base that gives way has followed, (m,): how its step comes about looks like a delay of the
        wires."""
        return np.asarray(self.from_impact_s > SETTLING_S)


def make_grid(
    theta: FloatArray, valid: NDArray[np.bool_], swings: Swings, rate_hz: float, survey: Survey
) -> Grid:
    """Reference motion with its derivatives, from the rotation `theta`, (n,), rad, at `rate_hz`.

    Between impacts the rotation is a polynomial fitted to all samples of the half-cycle: a filter
    that keeps the impacts sharp leaves far too much noise in the second derivative, and noise in an
    explanatory variable biases every coefficient.
    """
    n = theta.size
    smooth = sosfiltfilt(butter(4, SMOOTH_HZ, fs=rate_hz, output="sos"), theta)
    omega, alpha = np.zeros(n), np.zeros(n)
    release = round(swings.release_s * rate_hz)
    crossings = _impact_samples(theta, smooth, release)
    ends = [release, *crossings]
    guard = int(0.004 * rate_hz)
    for start, stop in itertools.pairwise(ends):
        inside = np.arange(start + (0 if start == release else guard), stop - guard)
        if inside.size < 60:
            continue
        fitted = _polynomial(theta[inside])
        whole = np.arange(start, stop)
        position = 2.0 * (whole - inside[0]) / (inside[-1] - inside[0]) - 1.0
        scale = 2.0 * rate_hz / (inside[-1] - inside[0])
        smooth[whole] = fitted(position)
        omega[whole] = fitted.deriv(1)(position) * scale
        alpha[whole] = fitted.deriv(2)(position) * scale**2
    time_s = coarse(np.arange(n) / rate_hz, rate_hz) - swings.release_s
    impact_s = np.array(crossings) / rate_hz - swings.release_s
    good = coarse(valid.astype(float), rate_hz) == 1.0  # at every sample
    rotation, rate, acceleration = (coarse(v, rate_hz) for v in (smooth, omega, alpha))
    before, after = _speeds(np.abs(rotation), rate, time_s, impact_s, survey)
    side = np.sign(np.interp(impact_s - 0.02, time_s, rotation))
    return Grid(
        time_s,
        rotation,
        rate,
        acceleration,
        from_impact_s=np.abs(time_s[:, None] - impact_s[None, :]).min(axis=1, initial=np.inf),
        valid=good,
        impact_s=impact_s,
        raw=coarse(theta, rate_hz),
        rest_s=swings.rest_s - swings.release_s,
        speed=omega,
        jumps=side * (before - after),
        approach=-side * before,
        slips=np.zeros(time_s.size, dtype=np.bool_),
    )


def _polynomial(values: FloatArray) -> Chebyshev:
    """Least-squares polynomial through evenly spaced values, from −1 to 1.

    By normal equations: those of Chebyshev's polynomials are well conditioned, and a decomposition of the
    whole table takes ten times as long.
    """
    table = chebvander(np.linspace(-1.0, 1.0, values.size), POLYNOMIAL_DEGREE)
    return Chebyshev(np.linalg.solve(table.T @ table, table.T @ values), domain=[-1.0, 1.0])


def _speeds(
    size: FloatArray, rate: FloatArray, time_s: FloatArray, impact_s: FloatArray, survey: Survey
) -> tuple[FloatArray, FloatArray]:
    """Speeds before and after each impact, from the peaks around it: ½ω² = p² (cos(α − φ) − cos α).

    A jump is the small difference of two speeds. Read off the motion beside the impact it would carry
    an error of its own size, and what follows from it would look weaker than it is. Only what is let go
    slowly, held back or pushed comes down with another speed than from rest.
    """
    edges = np.append(np.searchsorted(time_s, impact_s), time_s.size)
    # The held rotation, not the overshoot of the pull.
    first = float(size[(time_s > -0.05) & (np.arange(time_s.size) < edges[0])].max(initial=0.0))
    peaks = np.array([first, *(float(size[a:b].max(initial=0.0)) for a, b in itertools.pairwise(edges))])
    alpha = survey.alpha_rad

    def height(angle: FloatArray) -> FloatArray:
        return np.asarray(np.cos(alpha - np.minimum(angle, alpha)) - np.cos(alpha))

    speeds = survey.p_rad_s * np.sqrt(2.0 * height(peaks))
    shares = np.full(min(_FALLS, impact_s.size), np.nan)
    for k, (at, speed) in enumerate(zip(impact_s[:_FALLS], speeds, strict=False)):
        seen = (time_s > at - _END_OF_FALL_S[0]) & (time_s < at - _END_OF_FALL_S[1])
        if speed > 0.0 and np.count_nonzero(seen) > 4:
            square = np.mean(rate[seen] ** 2 + 2.0 * survey.p_rad_s**2 * height(size[seen]))
            shares[k] = np.sqrt(square) / speed
    # All falls are off alike where the wall is not quite that of the survey.
    later = shares[1:][np.isfinite(shares[1:])]
    share = float(shares[0] / np.median(later)) if later.size else np.nan
    approach = speeds[:-1].copy()
    if abs(share - 1.0) > AS_FROM_REST:
        approach[0] *= share
    return approach, speeds[1:]


def _impact_samples(theta: FloatArray, smooth: FloatArray, release: int) -> list[int]:
    """Samples at which the rotation passes zero, until half-cycles become too short to see."""
    impacts: list[int] = []
    signs = np.sign(smooth)
    for k in np.flatnonzero(np.diff(signs) != 0).tolist():
        if k <= release:
            continue
        if impacts and (k - impacts[-1] < 100 or np.abs(smooth[impacts[-1] : k]).max() < SMALLEST_GRID_RAD):
            break
        # The smoothed record rounds the corner; the crossing itself is read from the raw one nearby.
        window = slice(max(k - 60, 0), k + 60)
        t = np.arange(-60, k + 60 - max(k - 60, 0) - 60)
        slope, level = np.polyfit(t, theta[window], 1)
        impacts.append(int(k + np.clip(-level / slope, -40, 40)) if slope else int(k))
    return impacts

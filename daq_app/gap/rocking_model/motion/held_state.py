"""Where a held wall is, and how fast it sways, at the instant at which it is let go.

Nobody holds five tonnes still. The sway is a smooth random motion: a Gaussian process with a Matérn 5/2
covariance, whose size and time scale are those under which the hold is most likely (Rasmussen and
Williams, Gaussian Processes for Machine Learning, 2006, sections 4.2 and 5.4). Its prediction at the
release is the state that the rocking begins from.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.tolerances.motion import LEFT_ITS_HOLD, STILL_HELD_S, SURELY_HELD_S

MEAN_S = 0.02
"""Means over which a held wall is looked at: their noise is low, and a sway of 3 Hz hardly changes in one."""
COURSE_S = np.linspace(-0.2, 0.06, 53)
"""Times about the release, s, at which the sway is told."""
_LONGEST_S = 1.0
_FEWEST = 12
_AHEAD = 3
"""Means by which one looks ahead for the end of the hold."""
_SCALES_S = np.geomspace(0.05, 1.6, 11)
_RATIOS = np.concatenate([[0.0], np.geomspace(0.1, 1e6, 22)])
"""Variance of the sway over that of the noise of a mean."""
_TIMED_BY = 0.1
"""Share of the held rotation by whose fall the release is timed."""
_LEVEL = 25.0
"""Variance, in variances of the sway, by which the rotation that it goes about may differ from its mean."""


@dataclass(frozen=True, slots=True)
class HeldState:
    """Rotation and speed at the release; both signed as the rotation is."""

    rotation_rad: float
    rotation_sd: float
    speed_rad_s: float
    speed_sd: float
    sway_speed_sd: float
    """Rms of the speed of the sway, rad/s."""
    course_rad: FloatArray
    """(k,) rotation in which it sways at the times `COURSE_S` from the release."""

    @property
    def away_rad_s(self) -> float:
        """Speed away from upright."""
        return float(np.sign(self.rotation_rad)) * self.speed_rad_s

    def course(self, time_s: FloatArray) -> FloatArray:
        """Rotation, rad, at times from the release at which the wall is still held; constant beyond them."""
        return np.interp(time_s, COURSE_S, self.course_rad)


def held_state(theta: FloatArray, release: float, noise_rad: float, rate_hz: float) -> HeldState:
    """State at sample `release` of a rotation (n,), rad, whose samples have a noise of `noise_rad`.

    The hold ends where the wall leaves what its sway predicts: a force that is paid out slowly moves it
    before the fall shows when it was let go.
    """
    step = max(round(MEAN_S * rate_hz), 1)
    end = max(int(release - STILL_HELD_S * rate_hz), step)
    count = max(min(end, int(_LONGEST_S * rate_hz)) // step, 1)
    means = theta[end - count * step : end].reshape(count, step).mean(axis=1)
    noise = noise_rad / np.sqrt(step)
    # Time of each mean's middle before the release, s.
    middles = np.arange(end - count * step, end, step, dtype=np.float64) + 0.5 * (step - 1)
    time_s: FloatArray = np.asarray((middles - release) / rate_hz, dtype=np.float64)
    if count < _FEWEST:
        sway = float(np.sqrt(max(np.var(means) - noise**2, 0.0)))
        middle, sd = float(means.mean()), float(np.hypot(sway, noise / np.sqrt(count)))
        fastest = sway / MEAN_S
        return HeldState(middle, sd, 0.0, fastest, fastest, np.full(COURSE_S.shape, middle))
    sure = max(int(np.searchsorted(time_s, -SURELY_HELD_S)), _FEWEST)
    process = _Process.of(time_s[:sure], means[:sure], noise)
    # A slow release leaves the hold by so little from one mean to the next that its own past hides it, and
    # always towards upright.
    side = float(np.sign(means[0]))
    while sure < count:
        ahead = min(sure + _AHEAD, count) - 1
        (expected,), (ahead_sd,) = process.rotation(time_s[:sure], means[:sure], time_s[ahead : ahead + 1])
        if side * (expected - means[ahead]) > LEFT_ITS_HOLD * np.hypot(ahead_sd, process.noise):
            break
        sure += 1
    course, course_sd = process.rotation(time_s[:sure], means[:sure], np.append(COURSE_S, 0.0))
    rotation, rotation_sd = float(course[-1]), float(course_sd[-1])
    speed, speed_sd = process.speed(time_s[:sure], means[:sure])
    fastest = process.sway_speed
    off_s = _timed_within(theta, release, rotation, process.sway, rate_hz)
    return HeldState(
        rotation,
        float(np.hypot(rotation_sd, off_s * fastest)),
        speed,
        float(np.hypot(speed_sd, min(off_s / process.scale_s, 1.0) * fastest)),
        fastest,
        course[:-1],
    )


def _timed_within(theta: FloatArray, release: float, held_rad: float, sway: float, rate_hz: float) -> float:
    """Error of a release, s, that is timed by a fall by a tenth: the sway over the speed there."""
    fallen = np.abs(theta[int(release) :]) < (1.0 - _TIMED_BY) * abs(held_rad)
    falling_s = float(np.argmax(fallen)) / rate_hz if fallen.any() else 0.0
    return sway * falling_s / (2.0 * _TIMED_BY * max(abs(held_rad), 1e-9))


@dataclass(frozen=True, slots=True)
class _Process:
    """Matérn 5/2 process of standard deviation `sway`, seen as means with white `noise`, rad."""

    sway: float
    scale_s: float
    noise: float

    @classmethod
    def of(cls, time_s: FloatArray, seen: FloatArray, noise: float) -> _Process:
        """The one under which `seen`, (n,), at `time_s` is most likely; its noise is at least `noise`."""
        off = seen - seen.mean()
        found = []
        # Rounded to a picosecond: releases between samples move the times of all means alike.
        spectra = _spectra(seen.size, round(float(time_s[1] - time_s[0]), 12))
        for scale, (values, vectors) in zip(_SCALES_S, spectra, strict=True):
            spread = _RATIOS[:, None] * values + 1.0
            squares = (off @ vectors) ** 2 / spread
            variance = np.maximum(squares.mean(axis=1), noise**2)
            likelihood = -0.5 * (
                squares.sum(axis=1) / variance + np.log(spread).sum(axis=1) + off.size * np.log(variance)
            )
            k = int(np.argmax(likelihood))
            sway, noisy = np.sqrt(_RATIOS[k] * variance[k]), np.sqrt(variance[k])
            found.append((float(likelihood[k]), cls(float(sway), float(scale), float(noisy))))
        return max(found, key=lambda entry: entry[0])[1]

    @property
    def sway_speed(self) -> float:
        """Standard deviation of its speed, rad/s."""
        return float(np.sqrt(5.0 / 3.0)) * self.sway / self.scale_s

    @property
    def _level(self) -> float:
        """Variance, rad², by which the rotation that it goes about may differ from the mean of the seen."""
        return _LEVEL * max(self.sway, self.noise) ** 2

    def rotation(
        self, time_s: FloatArray, seen: FloatArray, when_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Rotations at times (k,) and their sds, from `seen`, (n,), at `time_s`."""
        across = self.sway**2 * _matern(when_s[:, None] - time_s, self.scale_s) + self._level
        off, sd = self._off(time_s, seen, across, self.sway**2 + self._level)
        return seen.mean() + off, sd

    def speed(self, time_s: FloatArray, seen: FloatArray) -> tuple[float, float]:
        """Speed at time 0 and its sd, from `seen`, (n,), at `time_s`."""
        across = self.sway**2 * _matern_rate(-time_s[None, :], self.scale_s)
        speed, sd = self._off(time_s, seen, across, self.sway_speed**2)
        return float(speed[0]), float(sd[0])

    def _off(
        self, time_s: FloatArray, seen: FloatArray, across: FloatArray, variance: float
    ) -> tuple[FloatArray, FloatArray]:
        """Mean beyond that of `seen`, and sd, of quantities (k,) of a variance each, by their covariances
        with `seen`, (k, n)."""
        covariance = self.sway**2 * _matern(time_s[:, None] - time_s, self.scale_s) + self._level
        weights = np.linalg.solve(covariance + self.noise**2 * np.eye(seen.size), across.T).T
        left = variance - np.sum(weights * across, axis=1)
        return weights @ (seen - seen.mean()), np.sqrt(np.maximum(left, 0.0))


@lru_cache(maxsize=64)
def _spectra(count: int, apart_s: float) -> list[tuple[FloatArray, FloatArray]]:
    """Eigenvalues (n,) and eigenvectors (n, n) of the covariance of evenly spaced means, for each scale."""
    apart = apart_s * np.subtract.outer(np.arange(count), np.arange(count))
    spectra = (np.linalg.eigh(_matern(apart, scale) + _LEVEL) for scale in _SCALES_S)
    return [(np.maximum(values, 0.0), vectors) for values, vectors in spectra]


def _matern(apart_s: FloatArray, scale_s: float) -> FloatArray:
    x = np.sqrt(5.0) * np.abs(apart_s) / scale_s
    return np.asarray((1.0 + x + x**2 / 3.0) * np.exp(-x))


def _matern_rate(ahead_s: FloatArray, scale_s: float) -> FloatArray:
    """Derivative of the covariance with the time that one looks ahead, 1/s."""
    x = np.sqrt(5.0) * np.abs(ahead_s) / scale_s
    return np.asarray(-5.0 / 3.0 * ahead_s / scale_s**2 * (1.0 + x) * np.exp(-x))

"""Each wire, or LVDT of a face, against the others: gain, lag, drift, and how well their gain is known."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from daq_app.rocking.families.gain_error import gain_sigma_of_mean, single_gain_share

Floats = NDArray[np.float64]
DeviationKind = Literal["gain", "late", "drift"]

_MEAN_S = 0.005
_FEWEST = 100
_GAIN_CHANCE = 0.002
"""A wire is named where chance alone would name one in a family this seldom. A wire 1 % off moves r by less
than 0.0001: raising it names one in sound tests and spends what may be warned falsely on what r does not
feel."""
_LEAST_GAIN = 0.006
_LEAST_LAG_S = 0.0015
"""Ten times the lag of a sound channel; a drum that swings at 25 Hz is 2.5 ms late. Raising it leaves such a
wire's ringing, which looks like hops of the wall, in r."""
_LEAST_DRIFT_RAD = 4e-4
"""Over the record; a fifth of what a wall's sway does to one wire alone."""


@dataclass(frozen=True, slots=True)
class ComparedChannels:
    """Deviations of each channel from the median of all; arrays (channels,)."""

    gain: Floats
    lag_s: Floats
    drift_rad: Floats
    """Over the span looked at."""

    def outlier(self) -> tuple[int, DeviationKind] | None:
        """The wire of all that deviates most beyond its kind's limit, and the kind: gain, late or drift."""
        count = self.gain.size
        if count < 4:
            return None
        candidates: list[tuple[float, int, DeviationKind]] = []
        worst = int(np.argmax(np.abs(self.gain - np.median(self.gain))))
        others = np.delete(self.gain, worst)
        deviation = float(self.gain[worst] - others.mean())
        spread, freedom = single_gain_share(others - others.mean(), others.size - 1.0)
        t = abs(deviation) / (spread * math.sqrt(1.0 + 1.0 / others.size))
        if 2.0 * count * float(stdtr(freedom, -t)) < _GAIN_CHANCE and abs(deviation) > _LEAST_GAIN:
            candidates.append((abs(deviation) / _LEAST_GAIN, worst, "gain"))
        kinds: tuple[tuple[Floats, float, DeviationKind], ...] = (
            (self.lag_s, _LEAST_LAG_S, "late"),
            (self.drift_rad, _LEAST_DRIFT_RAD, "drift"),
        )
        for values, limit, kind in kinds:
            apart = values - np.median(values)
            place = int(np.argmax(np.abs(apart)))
            rest = float(np.median(np.abs(np.delete(apart, place))))
            if abs(apart[place]) > max(limit, 5.0 * rest):
                candidates.append((abs(float(apart[place])) / limit, place, kind))
        if not candidates:
            return None
        _, place, kind = max(candidates)
        return place, kind

    def family_gain_sigma(self, weights: Floats) -> float:
        """Standard uncertainty of the gain of the wires' weighted mean, from how the wires differ."""
        return gain_sigma_of_mean(self.gain - self.gain.mean(), weights, self.gain.size - 1.0)


@dataclass(frozen=True, slots=True)
class ChannelMeans:
    """Each channel's own rotation as means of 5 ms."""

    means_rad: Floats
    """(channels, n), where all are finite."""
    step_s: float

    @classmethod
    def of(cls, own_rad: Floats, rate_hz: float) -> ChannelMeans | None:
        """From each channel's rotation (channels, n); None for two channels, or less than half a second."""
        size = max(1, round(_MEAN_S * rate_hz))
        groups = own_rad.shape[1] // size
        if groups < _FEWEST or own_rad.shape[0] < 3:
            return None
        means = own_rad[:, : groups * size].reshape(own_rad.shape[0], groups, size).mean(axis=2)
        means = means[:, np.isfinite(means).all(axis=0)]
        return None if means.shape[1] < _FEWEST else cls(means, size / rate_hz)


def compare_channels(channels: ChannelMeans, y_over_lever: Floats) -> ComparedChannels:
    """Each channel's own rotation against the median of all, less what of a twist is out of step.

    `y_over_lever` (channels,) is how much of a twist each channel shows.
    """
    means = channels.means_rad
    middle = np.median(means, axis=0)
    apart = means - middle
    twisted = y_over_lever - y_over_lever.mean()
    time = np.linspace(-0.5, 0.5, middle.size)
    speed = np.gradient(middle, channels.step_s)
    table = np.column_stack([middle, speed, time, np.ones(middle.size)])
    if float(twisted @ twisted) > 1e-6:
        # Only what of the twist is not in step with the rotation: the rest may be a gain.
        twist = twisted @ apart
        twist = twist - table @ np.linalg.lstsq(table, twist, rcond=None)[0]
        table = np.column_stack([table, twist])
    solution = np.linalg.lstsq(table, apart.T, rcond=None)[0]
    return ComparedChannels(solution[0], -solution[1], solution[2])

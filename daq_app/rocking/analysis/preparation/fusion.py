"""One best rotation from wires and LVDTs, and one best θ0 from all families, with uncertainty."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy  # its `special` is loaded with the first use: the window starts without it
from numpy.typing import NDArray

from daq_app.rocking.analysis.results import ValueWithSigma

Floats = NDArray[np.float64]

CALIBRATION_SHARE = 0.0014
"""Standard uncertainty of a family's calibration, as a share of the value: 0.2 % each of two."""
ZERO_SHARE_RAD = 3e-5
"""Standard uncertainty of a family's zero."""
_BY_CHANCE = 0.05
"""Chance below which values scatter more than their errors make them. Raising it makes the errors of sound
tests too large."""

_LEAST_RAD = 1e-7
"""Noise that a rotation has at least, for its weight: readings in wide steps show none."""


@dataclass(frozen=True, slots=True)
class Fused:
    """Best rotation (n,) with its standard uncertainty, and how the two families compare."""

    rotation_rad: Floats
    sigma_rad: Floats
    gain: float
    """Slope of LVDT rotation against wire rotation; 1 when they agree."""


def fuse(wires_rad: Floats, lvdts_rad: Floats, wire_noise_rad: float, lvdt_noise_rad: float) -> Fused:
    """Weighted mean by white noise where both are known; the other where only one is.

    The uncertainty holds the noise, the calibration and zero of both, and half of what the families
    differ by.
    """
    both = np.isfinite(wires_rad) & np.isfinite(lvdts_rad)
    gain, offset = 1.0, 0.0
    if np.count_nonzero(both) > 10 and np.ptp(wires_rad[both]) > 5e-3:
        x, y = wires_rad[both], lvdts_rad[both]
        gain = float(((x - x.mean()) @ (y - y.mean())) / ((x - x.mean()) @ (x - x.mean())))
        offset = float(y.mean() - gain * x.mean())
    wire_noise_rad, lvdt_noise_rad = (max(noise, _LEAST_RAD) for noise in (wire_noise_rad, lvdt_noise_rad))
    w, v = 1.0 / wire_noise_rad**2, 1.0 / lvdt_noise_rad**2
    rotation = np.where(
        both,
        (w * wires_rad + v * lvdts_rad) / (w + v),
        np.where(np.isfinite(wires_rad), wires_rad, lvdts_rad),
    )
    noise = np.where(
        both, 1.0 / math.sqrt(w + v), np.where(np.isfinite(wires_rad), wire_noise_rad, lvdt_noise_rad)
    )
    size = np.abs(rotation)
    share = np.where(both, CALIBRATION_SHARE / math.sqrt(2.0), CALIBRATION_SHARE)
    disagreement = 0.5 * np.abs((gain - 1.0) * size) + 0.5 * abs(offset)
    sigma = np.sqrt(noise**2 + (share * size) ** 2 + ZERO_SHARE_RAD**2 + disagreement**2)
    return Fused(rotation, sigma, gain)


def best_value(families: Mapping[str, ValueWithSigma]) -> ValueWithSigma:
    """Weighted mean of independent values; sigma widened where they scatter beyond their own (Birge, 1932).

    That is where chance makes them scatter so in less than one of twenty tests: widened wherever they scatter
    more than they do on average, the sigma of sound tests is too large, for it is never made smaller.
    """
    good = [v for v in families.values() if math.isfinite(v.value) and v.sigma > 0]
    if not good:
        return ValueWithSigma(math.nan, math.nan)
    weights = np.array([1.0 / v.sigma**2 for v in good])
    values = np.array([v.value for v in good])
    mean = float(weights @ values / weights.sum())
    sigma = 1.0 / math.sqrt(float(weights.sum()))
    if len(good) > 1:
        squares, freedom = float(weights @ (values - mean) ** 2), len(good) - 1
        if float(scipy.special.chdtrc(freedom, squares)) < _BY_CHANCE:
            sigma *= math.sqrt(squares / freedom)
    return ValueWithSigma(mean, sigma)

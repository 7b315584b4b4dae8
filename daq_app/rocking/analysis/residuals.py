"""What is left after the test: residual rotation by family, sliding of the base."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.analysis.preparation.signals import TILT_SETTLING_S, Signals
from daq_app.rocking.analysis.results import Residuals, ValueWithSigma

Floats = NDArray[np.float64]


def residuals_after(signals: Signals, rest: slice | None) -> Residuals | None:
    """Means over the rest (up to 2 s), against the zero before the test.

    None without a rest, or where the rest is what the zero was taken from.
    """
    if rest is None or signals.zeroed_at_rest:
        return None
    joint = signals.joint
    rate = signals.record.rate_hz
    settled = slice(min(rest.start + round(TILT_SETTLING_S * rate), rest.stop - 1), rest.stop)
    tilts = signals.tilts_rad[:, settled]
    return Residuals(
        rotation_wires_rad=_mean(signals.rotation_rad[rest]),
        rotation_lvdts_rad=None if joint is None else _mean(joint.rotation_rad[rest]),
        rotation_tilt_rad=_mean(tilts.mean(axis=0)) if tilts.shape[0] else None,
        sliding_m=_sliding(signals, rest),
    )


def _mean(values: Floats) -> ValueWithSigma:
    good = values[np.isfinite(values)]
    if good.size < 2:
        return ValueWithSigma(math.nan, math.nan)
    return ValueWithSigma(float(good.mean()), float(good.std(ddof=1)) / math.sqrt(good.size))


def _sliding(signals: Signals, rest: slice) -> ValueWithSigma | None:
    """Intercept at height 0 of the wires' displacements: shift u of the base, s_i = ±u + z_i θ.

    Wires that were left out of the rotation are left out here. None unless two heights remain.
    """
    wires = signals.geometry.wires
    good = np.array([signals.excluded_share.get(name, 0.0) < 0.01 for name in wires.ids])
    lever = wires.lever_m
    if np.unique(np.round(np.abs(lever[good]), 3)).size < 2:
        return None
    shift = wires.shortening_per_shift()
    values = signals.wires_m[:, rest]
    values = values[:, np.isfinite(values).all(axis=0)]
    if values.shape[1] < 2:
        return None
    weight = 1.0 / wires.noise_m[good]
    design = np.column_stack([shift[good], lever[good]]) * weight[:, None]
    covariance = np.linalg.inv(design.T @ design)
    solution = covariance @ design.T @ (values.mean(axis=1)[good] * weight)
    return ValueWithSigma(float(solution[0]), math.sqrt(float(covariance[0, 0]) / values.shape[1]))

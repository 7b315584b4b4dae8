"""Peak speeds as the paper took them, from the filtered velocity, and what the filter cost them.

The filtered velocity has one peak at each impact, smeared over the jump from θ̇⁻ to r θ̇⁻: it is
always below |θ̇⁻|, the more so the shorter the half-cycle, so EAV from these peaks comes out low.
`corrected_peaks` divides by the known ratio; the bias-free alternative is `daq_app.rocking.motion.arcs`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.estimators import eav_series, estimate_all
from daq_app.rocking.motion.velocity import VelocityFilter
from daq_app.rocking.theory.housner import exact_amplitude

Floats = NDArray[np.float64]

_REACH_S = 0.04


def filtered_peaks(
    time_s: Floats, velocity: Callable[[int, int], Floats], impacts_s: Sequence[float]
) -> Floats:
    """Signed peak of the filtered velocity at each impact; NaN where the record has none.

    `velocity(start, stop)` gives that of samples of the record, rad/s: only what lies about the impacts is
    asked for.
    """
    impacts = np.asarray(impacts_s, dtype=np.float64)
    gaps = np.diff(impacts, prepend=-np.inf, append=np.inf)
    reach = np.minimum(_REACH_S, 0.4 * np.minimum(gaps[:-1], gaps[1:]))
    starts, stops = np.searchsorted(time_s, [impacts - reach, impacts + reach]).tolist()
    peaks = np.full(impacts.size, np.nan)
    for k, (start, stop) in enumerate(zip(starts, stops, strict=True)):
        part = velocity(start, stop) if stop > start else np.empty(0)
        part = part[np.isfinite(part)]
        if part.size:
            peaks[k] = part[np.argmax(np.abs(part))]
    return peaks


def corrected_peaks(
    peaks_rad_s: Floats, velocity_filter: VelocityFilter, p_rad_s: float, alpha_rad: float
) -> Floats:
    """Peaks divided by the filter's known ratio for half-cycles of that speed; (n,) or (tests, n).

    The ratio depends on r and on the true speed, both found by repetition.
    """
    peaks = np.atleast_2d(np.asarray(peaks_rad_s, dtype=np.float64))
    corrected, exact = peaks, np.zeros(peaks.shape[1])
    for _ in range(3):
        estimates = estimate_all([eav_series(row, exact) for row in corrected])
        # The amplitude whose fall gives this speed: v² = 4 p² sin²(α/2) E.
        energy = (corrected / (2.0 * p_rad_s * np.sin(alpha_rad / 2.0))) ** 2
        amplitude = exact_amplitude(np.clip(energy, 1e-6, 0.98), alpha_rad)
        ratios = [
            velocity_filter.peak_ratio(row, min(estimate.r or 0.9, 0.999), p_rad_s, alpha_rad)
            for row, estimate in zip(amplitude, estimates, strict=True)
        ]
        corrected = peaks / np.array(ratios)
    return np.asarray(corrected.reshape(np.shape(peaks_rad_s)))

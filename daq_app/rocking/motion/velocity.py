"""The stated differentiator: θ̇ as the derivative of θ smoothed by a Gaussian, and what it costs.

The filter is a linear-phase FIR, the sampled derivative of a Gaussian low-pass with −3 dB at
`cutoff_hz`. A Gaussian's step response is monotone: the jump of θ̇ at an impact is smeared but never
overshoots, so peaks of the filtered speed are always too low, by an amount that `peak_ratio` knows.
Online and offline use the same coefficients.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from daq_app.rocking.theory.housner import exact_amplitude, exact_energy, exact_impact_speed, free_rocking

Floats = NDArray[np.float64]

_SUPPORT_SIGMAS = 4.0


@dataclass(frozen=True)
class VelocityFilter:
    """Linear-phase low-pass differentiator. `ValueError` for a cut-off the rate cannot carry."""

    rate_hz: float
    cutoff_hz: float
    coefficients: Floats = field(init=False, repr=False, compare=False)
    """(2·delay_samples + 1,) taps for convolution; a unit ramp gives exactly its slope."""

    def __post_init__(self) -> None:
        if not (self.rate_hz > 0 and 0 < self.cutoff_hz <= self.rate_hz / 8):
            raise ValueError(
                f"the velocity cut-off must lie between 0 and an eighth of the sampling rate "
                f"({self.rate_hz / 8:g} Hz), not {self.cutoff_hz:g} Hz"
            )
        index = np.arange(-self.delay_samples, self.delay_samples + 1)
        time = index / self.rate_hz
        taps = -time * np.exp(-0.5 * (time / self.sigma_s) ** 2)
        taps /= -np.sum(time * taps)
        object.__setattr__(self, "coefficients", taps)

    @property
    def sigma_s(self) -> float:
        """Standard deviation of the Gaussian in s: √(ln 2) / (2π f_c)."""
        return math.sqrt(math.log(2.0)) / (2.0 * math.pi * self.cutoff_hz)

    @property
    def delay_samples(self) -> int:
        """Group delay of the online filter."""
        return math.ceil(_SUPPORT_SIGMAS * self.sigma_s * self.rate_hz)

    @property
    def delay_s(self) -> float:
        return self.delay_samples / self.rate_hz

    @property
    def statement(self) -> str:
        """What a report says of the filter."""
        return (
            f"derivative of a Gaussian low-pass, −3 dB at {self.cutoff_hz:g} Hz, "
            f"{self.coefficients.size} taps at {self.rate_hz:g} Hz, zero phase (delay "
            f"{self.delay_s * 1e3:.1f} ms, taken out)"
        )

    def gain(self, frequency_hz: ArrayLike) -> Floats:
        """Amplitude relative to an ideal differentiator at these frequencies."""
        frequency = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
        index = np.arange(-self.delay_samples, self.delay_samples + 1)
        angle = 2.0 * np.pi * frequency[:, None] * index / self.rate_hz
        response = -(np.sin(angle) * self.coefficients).sum(axis=1)
        ideal = 2.0 * np.pi * frequency
        return np.asarray(np.where(ideal > 0, response / np.where(ideal > 0, ideal, 1.0), 1.0))

    def noise_rad_s(self, rotation_noise_rad: float) -> float:
        """rms of the velocity for white rotation noise of this rms."""
        return float(rotation_noise_rad * np.sqrt(np.sum(self.coefficients**2)))

    def velocity(self, rotation_rad: Floats) -> Floats:
        """θ̇ of a whole record, same length, zero phase; the ends are continued as constant."""
        padded = np.pad(rotation_rad, self.delay_samples, mode="edge")
        return np.convolve(padded, self.coefficients, mode="valid")

    def velocity_of_part(self, rotation_rad: Floats, start: int, stop: int) -> Floats:
        """θ̇ of samples start … stop of a whole record (n,), as `velocity` has it."""
        around = np.arange(start - self.delay_samples, stop + self.delay_samples)
        part = rotation_rad[np.clip(around, 0, rotation_rad.size - 1)]
        return np.convolve(part, self.coefficients, mode="valid")

    def peak_ratio(
        self, peak_before_rad: ArrayLike, restitution: float, p_rad_s: float, alpha_rad: float
    ) -> Floats:
        """Filtered peak speed at an impact over the true |θ̇⁻|, for half-cycles of these peaks.

        The loss has two sources: the jump to r·θ̇⁻ just after, and the corner that a decelerating
        rotation makes. Both grow as half-cycles shorten. Found by filtering exact Housner motion.
        """
        # Tables at every hundredth of r, and between them a line: the ratio is smooth in r.
        low = min(max(math.floor(restitution * 100.0), 1), 99)
        (log_peaks, below), (_, above) = (
            _ratio_table(self, r / 100.0, round(p_rad_s, 6), round(alpha_rad, 6)) for r in (low, low + 1)
        )
        share = restitution * 100.0 - low
        wanted = np.log(np.abs(np.asarray(peak_before_rad, dtype=np.float64)))
        return np.asarray(np.interp(wanted, log_peaks, (1.0 - share) * below + share * above))


@lru_cache(maxsize=64)
def _ratio_table(
    velocity_filter: VelocityFilter, restitution: float, p_rad_s: float, alpha_rad: float
) -> tuple[Floats, Floats]:
    """log(peak) and peak ratio on a grid from 0.001 α to 0.9 α."""
    peaks = alpha_rad * np.geomspace(1e-3, 0.9, 40)
    ratios = [_simulated_ratio(velocity_filter, peak, restitution, p_rad_s, alpha_rad) for peak in peaks]
    return np.log(peaks), np.array(ratios)


def _simulated_ratio(f: VelocityFilter, peak: float, restitution: float, p: float, alpha: float) -> float:
    """Filter exact motion around one impact whose half-cycle before has this peak."""
    before = 0
    start = peak
    # Short half-cycles see their neighbours through the filter: begin some impacts earlier.
    while before < 3:
        earlier = float(exact_energy(start, alpha)) / restitution**2
        if earlier >= 0.98:
            break
        start = float(exact_amplitude(earlier, alpha))
        before += 1
    motion = free_rocking(start, restitution, p, alpha, smallest_peak_rad=peak * 0.05, max_impacts=before + 6)
    reach = 2 * f.delay_samples
    time = motion.impacts_s[before] + np.arange(-reach, reach + 1) / f.rate_hz
    filtered = np.convolve(motion.at(time)[0], f.coefficients, mode="valid")
    return float(np.abs(filtered).max() / exact_impact_speed(peak, p, alpha))


class VelocityStream:
    """The same filter on a stream: velocities trail the input by `delay_samples`."""

    def __init__(self, velocity_filter: VelocityFilter) -> None:
        self._filter = velocity_filter
        self._tail: Floats | None = None

    def process(self, rotation_rad: Floats) -> Floats:
        """Velocities that have become known: (n,), the first call gives `delay_samples` fewer."""
        if rotation_rad.size == 0:
            return np.empty(0)
        if self._tail is None:
            self._tail = np.full(self._filter.delay_samples, rotation_rad[0])
        joined = np.concatenate((self._tail, rotation_rad))
        keep = 2 * self._filter.delay_samples
        self._tail = joined[-keep:]
        if joined.size <= keep:
            return np.empty(0)
        return np.convolve(joined, self._filter.coefficients, mode="valid")

"""From impacts to r: collects half-cycles one by one. Online and offline both go through here."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.estimators import (
    FEWEST_POINTS,
    DecaySeries,
    RestitutionEstimate,
    crt_series,
    eav_series,
    estimate_all,
)
from daq_app.rocking.means import means_over
from daq_app.rocking.motion.arcs import Arc, fit_arcs
from daq_app.rocking.motion.release import Release, locate_release

Floats = NDArray[np.float64]

ZERO_SIGMA_RAD = 2e-5
"""What the tared zero of the rotation may be wrong by."""
REST_ZERO_SIGMA_RAD = 5e-6
"""What a zero from the rest after the test may be wrong by: it is seconds old, where a tare is minutes old.
The walking zeros of drawn laboratories (0.15 of a channel's noise in a record) leave about this; raising it
widens the stated errors of impact times, half-cycles and peaks."""
_HOLD_S = 0.15
"""The rotation at the release is read from a line through this last part of the hold, s: a wall sways on what
holds it, at some 1 Hz (assumed). Raising it to 0.3 makes the line, and the mean, miss 0.08 and 0.14 % of θ0
where walls sway by 0.1 to 0.3 % of it; with this the line misses 0.06 %."""
_NOT_YET_S = 0.005
"""The hold is read up to so long before the release, s: what lets go takes some milliseconds."""
_HOLD_POINT_S = 0.02
_REFERENCE_S = (1.0, 0.5)
"""Before a release that was no clean one, the hold is taken to be still over this span."""
_LEFT_SIGMAS = 4.0
"""Means of 20 ms that are further from the level of the still hold, in their scatter, belong to the fall."""
_SLOW_RELEASE_SHARE = 0.002
"""Misfit of hold and free fall, as a share of θ0, above which the end of the still hold is looked for and θ0
makes no r: clean releases of drawn laboratories stay below 0.0011, letting go within 100 ms leaves 0.003."""


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """What the half-cycles are judged with."""

    rate_hz: float
    p_rad_s: float
    alpha_rad: float
    zero_sigma_rad: float = ZERO_SIGMA_RAD
    slow_noise_rad: float = 0.0
    """rms of one sample of the white noise whose long means scatter as the rotation's do; 0: not known."""


@dataclass(frozen=True, slots=True)
class ImpactTime:
    """When an impact was, by the half-cycles beside it; errors are NaN where none was fitted."""

    time_s: float
    noise_s: float
    """Standard uncertainty by noise, another one at every impact."""
    zero_s: float
    """The same by the zero of the rotation: one error for all impacts, forwards and backwards by turns."""


@dataclass
class MotionTrack:
    """The motion after one release, growing impact by impact. Times in s, absolute (sample / rate)."""

    settings: MotionSettings
    release: Release
    theta0_rad: float
    """Rotation just before the release, from the same signal as the peaks."""
    sigma_theta0_rad: float
    held_until_s: float
    """End of the still hold: the release, or earlier where the wall was let go slowly."""
    crossings_s: list[float] = field(default_factory=list)
    """Impacts as detected."""
    arcs: list[Arc | None] = field(default_factory=list)
    """Arc n ends at impact n + 1; None where it could not be fitted."""
    _impacts: list[ImpactTime] = field(default_factory=list, init=False, repr=False, compare=False)
    """Those that were asked for so far; the next half-cycle changes the last of them."""

    @classmethod
    def begin(
        cls, settings: MotionSettings, time_s: Floats, rotation_rad: Floats, release_s: float, hold_rad: float
    ) -> MotionTrack:
        """Start at a release near `release_s` from about `hold_rad`.

        `time_s`, `rotation_rad` (n,) reach from before the release to the first impact.
        """
        size = max(1, round(0.005 * settings.rate_hz))
        t, y = means_over(time_s, size), means_over(rotation_rad, size)
        inside = (t > release_s - 0.5) & (y * math.copysign(1.0, hold_rad) > 0.03 * abs(hold_rad))
        release = locate_release(t[inside], y[inside], hold_rad, settings.p_rad_s, settings.alpha_rad)
        if release is None or abs(release.time_s - release_s) > 0.3:
            release = Release(release_s, hold_rad, math.nan)
        held_until_s = release.time_s
        if not _is_free_fall(release, hold_rad):
            held_until_s = _end_of_hold(time_s, rotation_rad, release.time_s, settings.rate_hz)
        level, sigma = hold_level(time_s, rotation_rad, held_until_s, settings)
        if not math.isfinite(level):
            level, sigma = release.rotation_rad, max(abs(release.rotation_rad - hold_rad), ZERO_SIGMA_RAD)
        return cls(settings, release, level, sigma, held_until_s)

    def add_impact(self, crossing_s: float, time_s: Floats, rotation_rad: Floats) -> Arc | None:
        """Impact at about `crossing_s` ends a half-cycle, which is fitted and returned."""
        return self.add_impacts([crossing_s], time_s, rotation_rad)[0]

    def add_impacts(
        self, crossings_s: Sequence[float], time_s: Floats, rotation_rad: Floats
    ) -> list[Arc | None]:
        """The same for the next impacts, all at once."""
        arcs = fit_arcs(
            time_s,
            rotation_rad,
            [self.crossings_s[-1] if self.crossings_s else self.release.time_s, *crossings_s],
            first_index=len(self.crossings_s),
            p_rad_s=self.settings.p_rad_s,
            alpha_rad=self.settings.alpha_rad,
            zero_sigma_rad=self.settings.zero_sigma_rad,
            slow_noise_rad=self.settings.slow_noise_rad,
        )
        self.crossings_s.extend(crossings_s)
        self.arcs.extend(arcs)
        self._impacts = self._impacts[:-1]
        return arcs

    def fitted_again(
        self, p_rad_s: float, alpha_rad: float, time_s: Floats, rotation_rad: Floats
    ) -> MotionTrack:
        """The same half-cycles fitted with another p and α; `time_s`, `rotation_rad` (n,) cover them."""
        settings = replace(self.settings, p_rad_s=p_rad_s, alpha_rad=alpha_rad)
        again = replace(self, settings=settings, crossings_s=[], arcs=[])
        again.add_impacts(self.crossings_s, time_s, rotation_rad)
        return again

    @property
    def impacts_s(self) -> list[float]:
        """Impact times: both neighbouring half-cycles' zero crossings, weighted; else as detected."""
        return [impact.time_s for impact in self.impacts]

    @property
    def impacts(self) -> list[ImpactTime]:
        """Impact times with their errors."""
        further = range(len(self._impacts), len(self.crossings_s))
        self._impacts = [*self._impacts, *(self._impact(index) for index in further)]
        return self._impacts

    def _impact(self, index: int) -> ImpactTime:
        before = self.arcs[index]
        after = self.arcs[index + 1] if index + 1 < len(self.arcs) else None
        known = [] if before is None else [(before.end_s, before.sigma_end_s, before.speed_end_rad_s)]
        if after is not None:
            known.append((after.start_s, after.sigma_start_s, after.speed_start_rad_s))
        if not known:
            return ImpactTime(self.crossings_s[index], math.nan, math.nan)
        weights = [1.0 / max(sigma, 1e-9) ** 2 for _, sigma, _ in known]
        total = sum(weights)
        time_s = sum(w * t for w, (t, _, _) in zip(weights, known, strict=True)) / total
        # The wall passes both crossings in one direction: an error of the zero moves both alike.
        zeros = [self.settings.zero_sigma_rad / abs(speed) for _, _, speed in known]
        noises = [math.sqrt(max(s**2 - zero**2, 0.0)) for zero, (_, s, _) in zip(zeros, known, strict=True)]
        return ImpactTime(
            time_s,
            math.hypot(*(w * noise for w, noise in zip(weights, noises, strict=True))) / total,
            sum(w * zero for w, zero in zip(weights, zeros, strict=True)) / total,
        )

    @property
    def peaks_rad(self) -> list[float]:
        """Signed peaks, the release first; NaN where a half-cycle could not be fitted."""
        return [self.theta0_rad, *(math.nan if arc is None else arc.peak_rad for arc in self.arcs[1:])]

    @property
    def sigma_peaks_rad(self) -> list[float]:
        fitted = (math.nan if arc is None else arc.sigma_peak_rad for arc in self.arcs[1:])
        return [self.sigma_theta0_rad, *fitted]

    @property
    def speeds_before_rad_s(self) -> list[float]:
        """Signed θ̇⁻ at each impact."""
        return [math.nan if arc is None else arc.speed_end_rad_s for arc in self.arcs]

    @property
    def sigma_speeds_before_rad_s(self) -> list[float]:
        return [math.nan if arc is None else arc.sigma_speed_end_rad_s for arc in self.arcs]

    @property
    def speeds_after_rad_s(self) -> list[float]:
        """Signed θ̇⁺ at each impact; NaN for the last, whose half-cycle is not complete."""
        after: Sequence[Arc | None] = [*self.arcs[1:], None]
        return [math.nan if arc is None else arc.speed_start_rad_s for arc in after[: len(self.arcs)]]

    @property
    def sigma_speeds_after_rad_s(self) -> list[float]:
        after: Sequence[Arc | None] = [*self.arcs[1:], None]
        return [math.nan if arc is None else arc.sigma_speed_start_rad_s for arc in after[: len(self.arcs)]]

    def eav(self) -> RestitutionEstimate:
        """EAV (4.4) from one-sided fits."""
        return estimate_all([self.eav_series()])[0]

    def crt(self) -> RestitutionEstimate:
        """CRT (4.5), the paper's linearised energy."""
        return estimate_all([self.crt_series()])[0]

    def eav_series(self, method: str = "EAV") -> DecaySeries:
        """What `eav` is found from: many series are estimated together at the cost of one."""
        return eav_series(self.speeds_before_rad_s, self.sigma_speeds_in_decay, method=method)

    def crt_series(self, method: str = "CRT") -> DecaySeries:
        """What `crt` is found from."""
        return crt_series(self.peaks_rad, self._sigmas_in_decay, self.settings.alpha_rad, method=method)

    def crt_exact_series(self, alpha_rad: float | None = None) -> DecaySeries:
        """CRT with the exact potential of the nonlinear equation; `alpha_rad`: where not the survey's."""
        alpha, method = alpha_rad or self.settings.alpha_rad, "CRT exact potential"
        return crt_series(self.peaks_rad, self._sigmas_in_decay, alpha, exact=True, method=method)

    @property
    def fell_freely(self) -> bool:
        """Whether the wall falls as a block does from rest at θ0, so that θ0 is a peak of its decay."""
        return _is_free_fall(self.release, self.theta0_rad)

    @property
    def misfit_of_fall(self) -> float:
        """rms misfit of hold and free fall as a share of θ0; 1 where no fall was found."""
        share = self.release.residual_rad / abs(self.theta0_rad)
        return share if math.isfinite(share) else 1.0

    @property
    def sigma_speeds_in_decay(self) -> list[float]:
        """Those of θ̇⁻; NaN at the first impact of a wall that did not fall freely, where enough are left.

        What still holds it bends its first half-cycle as no block's, and the fit's end of that with it. Fewer
        points than show a scatter would state next to no error.
        """
        sigmas = self.sigma_speeds_before_rad_s
        if self.fell_freely or not sigmas:
            return sigmas
        later = [math.nan, *sigmas[1:]]
        return later if len(eav_series(self.speeds_before_rad_s, later).points) >= FEWEST_POINTS else sigmas

    @property
    def _sigmas_in_decay(self) -> list[float]:
        return self.sigma_peaks_rad if self.fell_freely else [math.nan, *self.sigma_peaks_rad[1:]]


def _is_free_fall(release: Release, theta0_rad: float) -> bool:
    return release.residual_rad <= _SLOW_RELEASE_SHARE * abs(theta0_rad)


def _end_of_hold(time_s: Floats, rotation_rad: Floats, release_s: float, rate_hz: float) -> float:
    """When the rotation was last at the level of the still hold; the release where no hold is known."""
    size = max(1, round(_HOLD_POINT_S * rate_hz))
    still = slice(*np.searchsorted(time_s, [release_s - before for before in _REFERENCE_S]))
    after = slice(still.stop, int(np.searchsorted(time_s, release_s)))
    reference, points = _means(rotation_rad[still], size), _means(rotation_rad[after], size)
    if np.count_nonzero(np.isfinite(reference)) < 3:
        return release_s
    level, scatter = np.nanmedian(reference), np.nanstd(reference, ddof=1)
    held = np.flatnonzero(np.abs(points - level) < _LEFT_SIGMAS * scatter)
    if not held.size:
        return float(time_s[still.stop])
    left = points.size - 1 - held[-1]
    return release_s - float(left) * size / rate_hz


def _means(signal: Floats, size: int) -> Floats:
    """Means of `size` samples each, up to the last sample."""
    return means_over(signal[signal.size % size :], size)


def hold_level(
    time_s: Floats, rotation_rad: Floats, release_s: float, settings: MotionSettings
) -> tuple[float, float]:
    """Rotation that the wall is let go from, and its sigma by what the line through the hold leaves."""
    low, high = np.searchsorted(time_s, [release_s - _HOLD_S, release_s - _NOT_YET_S])
    level, sigma = _level_at_release(rotation_rad[low:high], settings.rate_hz)
    return level, math.hypot(sigma, settings.zero_sigma_rad)


def _level_at_release(signal: Floats, rate_hz: float) -> tuple[float, float]:
    """Value at the release of the line through 20 ms means of a signal (n,), and its sigma.

    `signal` ends `_NOT_YET_S` before the release. With fewer than four means the wall counts as still.
    """
    points = _means(signal, max(1, round(_HOLD_POINT_S * rate_hz)))
    ahead_s = -_NOT_YET_S - _HOLD_POINT_S * (np.arange(points.size)[::-1] + 0.5)
    good = np.isfinite(points)
    count = int(np.count_nonzero(good))
    if count < 4:
        return steady_level(signal, rate_hz)
    x, y = ahead_s[good], points[good]
    centred = x - x.mean()
    spread = float(centred @ centred)
    slope = float(centred @ y) / spread
    left = y - y.mean() - slope * centred
    variance = float(left @ left) / (count - 2) * (1.0 / count + float(x.mean()) ** 2 / spread)
    return float(y.mean() - slope * x.mean()), math.sqrt(variance)


def steady_level(signal: Floats, rate_hz: float) -> tuple[float, float]:
    """Mean of a signal (n,) that should stand still, and its sigma from how its 20 ms means scatter.

    NaN for both with fewer than three such means.
    """
    size = max(1, round(_HOLD_POINT_S * rate_hz))
    points = _means(signal, size)
    points = points[np.isfinite(points)]
    if points.size < 3:
        return math.nan, math.nan
    return float(points.mean()), float(points.std(ddof=1)) / math.sqrt(points.size)

"""Exact free rocking of Housner's nonlinear block: θ̈ = −p² sin(α·sgn θ − θ), impacts θ̇⁺ = r θ̇⁻.

With u = α − |θ| the equation is ü = p² sin u, a pendulum near its upper rest, so each half-cycle is
a Jacobi elliptic function: for a peak at time 0 with u = u_p,

    sin(u/2) = sin(u_p/2) · nd(p t | m),   m = cos²(u_p/2)                    (nd = 1/dn)

(the classical solution of the pendulum, e.g. NIST DLMF 22.19.2, shifted by half a turn). There is no
time step and no truncation error. A base off level or a mass off the middle makes α larger to one side by as
much as it makes it smaller to the other: α ± lean. Names say *exact* where
`daq_app.rocking.theory.classic` has a linearised twin. Functions work element by element on scalars or
arrays that broadcast.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # its `special` is loaded with the first use: the window starts without it
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

OVERTURNED = 0.9999
"""Energy ratio beyond which a block does not turn: the motion of one that leans over to its weaker side with
more is followed as if it had this."""
_NODES = 64
"""Intervals between peak and impact of the interpolated rotation."""


def exact_energy(theta_rad: ArrayLike, alpha_rad: ArrayLike) -> Floats:
    """Potential energy at |θ| as a fraction of the barrier: 1 − (1 − cos(α−|θ|)) / (1 − cos α)."""
    alpha = np.asarray(alpha_rad, dtype=np.float64)
    u = alpha - np.abs(np.asarray(theta_rad, dtype=np.float64))
    return np.asarray(1.0 - (np.sin(u / 2.0) / np.sin(alpha / 2.0)) ** 2)


def exact_amplitude(energy_ratio: ArrayLike, alpha_rad: ArrayLike) -> Floats:
    """|θ| of the given energy ratio, the inverse of `exact_energy`."""
    ratio = np.asarray(energy_ratio, dtype=np.float64)
    alpha = np.asarray(alpha_rad, dtype=np.float64)
    return np.asarray(alpha - 2.0 * np.arcsin(np.sin(alpha / 2.0) * np.sqrt(1.0 - ratio)))


def exact_impact_speed(peak_rad: ArrayLike, p_rad_s: float, alpha_rad: ArrayLike) -> Floats:
    """|θ̇| at θ = 0 of the half-cycle with this peak: θ̇² = 2p²(cos(α−θ_p) − cos α)."""
    half = np.asarray(alpha_rad, dtype=np.float64) / 2.0
    return np.asarray(2.0 * p_rad_s * np.sin(half) * np.sqrt(exact_energy(peak_rad, alpha_rad)))


def exact_quarter_period(peak_rad: ArrayLike, p_rad_s: float, alpha_rad: ArrayLike) -> Floats:
    """Time in s from the peak to the impact: a quarter of the full period at constant amplitude."""
    peak = np.abs(np.asarray(peak_rad, dtype=np.float64))
    alpha = np.asarray(alpha_rad, dtype=np.float64)
    sin_peak = np.sin((alpha - peak) / 2.0)
    m = 1.0 - sin_peak**2
    # sn² = (1 − dn²)/m at the impact, where dn = sin(u_p/2)/sin(α/2); the difference of the squared
    # sines is written as a product, so that tiny peaks lose no digits.
    difference = np.sin(alpha - peak / 2.0) * np.sin(peak / 2.0)
    sn = np.sqrt(difference / m) / np.sin(alpha / 2.0)
    return np.asarray(scipy.special.ellipkinc(np.arcsin(np.minimum(sn, 1.0)), m) / p_rad_s)


def exact_period(peak_rad: ArrayLike, p_rad_s: float, alpha_rad: float) -> Floats:
    """Full period in s at constant amplitude, the nonlinear twin of (4.1)."""
    return 4.0 * exact_quarter_period(peak_rad, p_rad_s, alpha_rad)


def half_cycle_rotation(
    time_from_peak_s: ArrayLike, peak_rad: ArrayLike, p_rad_s: float, alpha_rad: ArrayLike
) -> tuple[Floats, Floats]:
    """|θ| and d|θ|/dt at times from the peak (negative before it); inputs broadcast together."""
    time = np.asarray(time_from_peak_s, dtype=np.float64)
    peak = np.abs(np.asarray(peak_rad, dtype=np.float64))
    alpha = np.asarray(alpha_rad, dtype=np.float64)
    sin_peak = np.sin((alpha - peak) / 2.0)
    m = 1.0 - sin_peak * sin_peak
    sn, _, dn, _ = scipy.special.ellipj(p_rad_s * time, m)
    half = np.arcsin(np.minimum(sin_peak / dn, 1.0))
    # cos(u/2) = k·cn/dn from the same identity; its derivative gives the speed without a difference.
    speed = -2.0 * p_rad_s * sin_peak * np.sqrt(m) * sn / dn
    return np.asarray(alpha - 2.0 * half), np.asarray(speed)


@dataclass(frozen=True, slots=True)
class FreeRocking:
    """A whole decaying motion: peaks and impacts, and rotation at any time.

    Held at `peaks_rad[0]` until `release_s`; after the last impact computed the wall lies still.
    """

    p_rad_s: float
    alpha_rad: float
    release_s: float
    side: int
    """Sign of the release rotation."""
    peaks_rad: Floats
    """|θ| peaks: the release, then the peak after each impact; shape (n_impacts + 1,)."""
    impacts_s: Floats
    """Times of the impacts; shape (n_impacts,)."""
    restitution: Floats
    """r of each impact; shape (n_impacts,)."""
    lean_rad: float = 0.0
    """By how much α is larger where θ > 0, and smaller where θ < 0, than `alpha_rad`."""

    @property
    def alphas_rad(self) -> Floats:
        """α of each half-cycle, that of the side it is on; shape (n_impacts + 1,)."""
        return _alphas(self.alpha_rad, self.lean_rad, self.side, self.peaks_rad.size)

    @property
    def speeds_before_rad_s(self) -> Floats:
        """|θ̇⁻| at each impact."""
        return exact_impact_speed(self.peaks_rad[:-1], self.p_rad_s, self.alphas_rad[:-1])

    @property
    def speeds_after_rad_s(self) -> Floats:
        """|θ̇⁺| at each impact."""
        return self.restitution * self.speeds_before_rad_s

    def locate(self, time_s: ArrayLike) -> tuple[NDArray[np.int_], Floats, Floats]:
        """(half-cycle, time from its peak in s, sign of θ) at each time, of the shape of `time_s`.

        Before the release the time from the peak is 0; beyond the last half-cycle the sign is 0.
        """
        quarter = exact_quarter_period(self.peaks_rad, self.p_rad_s, self.alphas_rad)
        return place_in_half_cycles(time_s, self.release_s, self.impacts_s, quarter, self.side)

    def at(self, time_s: ArrayLike) -> tuple[Floats, Floats]:
        """θ and θ̇ at any times, rad and rad/s, signed."""
        index, local, sign = self.locate(time_s)
        rotation, speed = half_cycle_rotation(
            local, self.peaks_rad[index], self.p_rad_s, self.alphas_rad[index]
        )
        return sign * rotation, sign * speed

    def rotation(self, time_s: ArrayLike) -> Floats:
        """θ at very many times, rad, signed: within 2e-9 rad of `at`, at a small part of its cost.

        Cubic Hermite interpolation between exact rotations and speeds of each half-cycle.
        """
        index, local, sign = self.locate(time_s)
        quarter = exact_quarter_period(self.peaks_rad, self.p_rad_s, self.alphas_rad)
        # A half-cycle is symmetric about its peak: from there to the impact is enough.
        share = np.linspace(0.0, 1.0, _NODES + 1)
        nodes, speeds = half_cycle_rotation(
            quarter[:, None] * share, self.peaks_rad[:, None], self.p_rad_s, self.alphas_rad[:, None]
        )
        slopes = speeds * (quarter / _NODES)[:, None]
        place = np.minimum(np.abs(local) * (_NODES / quarter)[index], _NODES)
        node = np.minimum(place.astype(np.intp), _NODES - 1)
        u = place - node
        left = index * (_NODES + 1) + node
        low, low_slope = nodes.ravel()[left], slopes.ravel()[left]
        rise, high_slope = nodes.ravel()[left + 1] - low, slopes.ravel()[left + 1]
        bend = low_slope + high_slope - 2.0 * rise
        value = low + u * (low_slope + u * (rise - low_slope - bend + u * bend))
        return np.asarray(sign * value)


def free_rocking(
    theta0_rad: float,
    restitution: ArrayLike,
    p_rad_s: float,
    alpha_rad: float,
    *,
    release_s: float = 0.0,
    smallest_peak_rad: float = 1e-4,
    max_impacts: int = 400,
    lean_rad: float = 0.0,
) -> FreeRocking:
    """The motion after a release from rest at `theta0_rad` (either side).

    `restitution` is one r, or one per impact (the last is used for all further ones). Impacts are
    computed until the next peak would be below `smallest_peak_rad`. `lean_rad`: α is larger by it where
    θ > 0, and smaller where θ < 0. `ValueError` for a release beyond α, which overturns.
    """
    peak0, side = abs(theta0_rad), 1 if theta0_rad > 0 else -1
    alphas = _alphas(alpha_rad, lean_rad, side, max_impacts + 1)
    if not 0.0 < peak0 < alphas[0]:
        raise ValueError(
            f"the release rotation must lie between 0 and α = {alphas[0]:g} rad, not {theta0_rad:g}"
        )
    rs = np.atleast_1d(np.asarray(restitution, dtype=np.float64))
    if np.any((rs <= 0.0) | (rs > 1.0)):
        raise ValueError("the coefficient of restitution must lie in (0, 1]")
    sequence = np.concatenate((rs, np.full(max(max_impacts - rs.size, 0), rs[-1])))[:max_impacts]
    # Energies are shares of what overturns the block to the side that it is on.
    barriers = (np.sin(alphas[0] / 2.0) / np.sin(alphas[1:] / 2.0)) ** 2
    energies = float(exact_energy(peak0, alphas[0])) * np.cumprod(sequence**2) * barriers
    following = exact_amplitude(np.minimum(energies, OVERTURNED), alphas[1:])
    small = np.flatnonzero(following < smallest_peak_rad)
    n = int(small[0]) + 1 if small.size else max_impacts
    peaks = np.concatenate(([peak0], following[:n]))
    quarter = exact_quarter_period(peaks, p_rad_s, alphas[: peaks.size])
    impacts = impact_times(release_s, quarter)
    return FreeRocking(p_rad_s, alpha_rad, release_s, side, peaks, impacts, sequence[:n].copy(), lean_rad)


def place_in_half_cycles(
    time_s: ArrayLike, release_s: float, impacts_s: Floats, quarters_s: Floats, side: int
) -> tuple[NDArray[np.int_], Floats, Floats]:
    """(half-cycle, time from its peak in s, sign of θ) at each time, as `FreeRocking.locate` has them.

    `impacts_s` (n,) and `quarters_s` (n + 1,), the time from each peak to the impact after it.
    """
    time = np.asarray(time_s, dtype=np.float64)
    index = np.searchsorted(impacts_s, time, side="right")
    peak_time = np.concatenate(([release_s], impacts_s + quarters_s[1:]))
    local = time - peak_time[index]
    local = np.where((index == 0) & (local < 0.0), 0.0, local)
    sign = side * np.where(index % 2 == 0, 1.0, -1.0)
    return index, local, np.where(local > quarters_s[index], 0.0, sign)


def impact_times(release_s: float, quarters_s: Floats) -> Floats:
    """Times of the impacts, (n,), after a release from rest, for quarters (n + 1,) from peaks to impacts."""
    return np.asarray(release_s + np.concatenate(([quarters_s[0]], 2.0 * quarters_s[1:-1])).cumsum())


def _alphas(alpha_rad: float, lean_rad: float, side: int, half_cycles: int) -> Floats:
    """α of each half-cycle, (half_cycles,), the first at `side`."""
    return np.asarray(alpha_rad + side * lean_rad * (1.0 - 2.0 * (np.arange(half_cycles) % 2)))

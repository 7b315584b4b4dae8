"""Edges that yield: the wall stands on an elastic strip, and the lever of its weight is shorter near upright.

The strip (Winkler's bed without tension, width w, stiffness k per unit of area, length l) carries the weight
W at |θ| = 0 evenly, so that its resultant is w/2 inside the edge. It moves outwards as the wall turns, until
at θ₁ = 2 W/(k l w²) the inner end of the strip lifts off; beyond, the length in contact falls as 1/√θ:

    c(θ) = w/2 (1 − θ/(3 θ₁))  for θ ≤ θ₁,    c(θ) = (w/3) √(θ₁/θ)  beyond,

with θ̈ = −p² (sin(α − θ) − c/R) and R from the edge to the centre of mass. It is the beam on a bed of Costa et
al., section 2, with a bed as wide as the strip. c (1 − cos θ) is left out, 0.4 % of c at θ = 0.09, and that
the inertia about a point inside the edge is smaller, 7 % of c for FR1. Functions work element by element.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from daq_app.rocking.theory.housner import (
    OVERTURNED,
    FreeRocking,
    exact_amplitude,
    exact_energy,
    exact_quarter_period,
    free_rocking,
    half_cycle_rotation,
    impact_times,
    place_in_half_cycles,
)

Floats = NDArray[np.float64]

NODES = 16
"""Intervals between peak and impact at which the delay of a half-cycle is known."""
_ROUNDS = 3
"""Newton's steps from a sharp edge's peak to the one on the strip: the error squares itself with each."""
_LEAST_PEAK_RAD = 1e-12
"""Peak of a half-cycle at least: a search that strays to no r at all has none."""
_LEAST_ENERGY = 1e-9
"""Energy ratio of a release at least: a strip that takes more than the whole lever leaves none."""


@dataclass(frozen=True, slots=True)
class YieldingEdge:
    """The strip that both edges stand on, by what it does to the lever of the weight."""

    inset_rad: float
    """c/R at θ = 0, half the width of the strip over the distance from the edge to the centre of mass."""
    lift_rad: float
    """θ₁, |θ| at which the inner end of the strip lifts off; above 0."""

    def shortening(self, theta_rad: ArrayLike) -> Floats:
        """c/R, what sin(α − |θ|) lacks; of the shape of θ."""
        share = np.abs(np.asarray(theta_rad, dtype=np.float64)) / self.lift_rad
        beyond = 2.0 / 3.0 / np.sqrt(np.maximum(share, 1.0))
        return np.asarray(self.inset_rad * np.where(share < 1.0, 1.0 - share / 3.0, beyond))

    def work(self, theta_rad: ArrayLike) -> Floats:
        """∫ c/R d|θ| from 0, rad²; of the shape of θ."""
        share = np.abs(np.asarray(theta_rad, dtype=np.float64)) / self.lift_rad
        beyond = 4.0 / 3.0 * np.sqrt(np.maximum(share, 1.0)) - 0.5
        within = share * (1.0 - share / 6.0)
        return np.asarray(self.inset_rad * self.lift_rad * np.where(share < 1.0, within, beyond))

    def peak(self, sharp_peak_rad: Floats, alpha_rad: ArrayLike) -> Floats:
        """|θ| of the peak, (n,), with the energy that leads to `sharp_peak_rad`, (n,), on sharp edges."""
        alpha = np.asarray(alpha_rad, dtype=np.float64)
        peak = sharp_peak_rad
        for _ in range(_ROUNDS):
            # cos(α − θ) − cos(α − θ_sharp) as a product: tiny peaks lose no digits.
            middle, half = (peak + sharp_peak_rad) / 2.0, (peak - sharp_peak_rad) / 2.0
            gained = 2.0 * np.sin(alpha - middle) * np.sin(half)
            lever = np.sin(alpha - peak) - self.shortening(peak)
            # A block that leans over where the strip takes its whole lever turns nowhere: it goes on as on
            # sharp edges.
            missing = np.where(lever > 0.0, self.work(peak) - gained, 0.0)
            step = missing / np.where(lever > 0.0, lever, 1.0)
            peak = np.clip(peak + step, 0.5 * peak, 0.5 * (peak + alpha))
        return np.asarray(peak)

    def delays(self, peak_rad: Floats, p_rad_s: float, alpha_rad: ArrayLike) -> Floats:
        """Seconds by which each rotation comes later than on sharp edges, (n, `NODES` + 1), from the peak on.

        `peak_rad`, (n,); the nodes are evenly spaced in x = √(1 − |θ|/peak), from the peak to the impact.
        """
        peak = peak_rad[:, None]
        alpha = np.broadcast_to(np.asarray(alpha_rad, dtype=np.float64), peak_rad.shape)[:, None]
        x = np.linspace(0.0, 1.0, 2 * NODES + 1)[1:]
        fall = peak * x**2
        # θ̇²/2p² on sharp edges, and the share of it that the strip takes.
        sharp = 2.0 * np.sin(alpha - peak + fall / 2.0) * np.sin(fall / 2.0)
        share = (self.work(peak) - self.work(peak - fall)) / sharp
        at_peak = self.shortening(peak) / np.sin(alpha - peak)
        slowness = 2.0 * peak * x / (np.sqrt(2.0 * sharp) * p_rad_s)
        slowness = np.hstack((np.sqrt(2.0 * peak / np.sin(alpha - peak)) / p_rad_s, slowness))
        share = np.minimum(np.hstack((at_peak, share)), 0.9)
        later = slowness * np.expm1(-0.5 * np.log1p(-share))
        # Simpson's rule, two intervals to a node.
        pieces = (later[:, 0:-2:2] + 4.0 * later[:, 1:-1:2] + later[:, 2::2]) / (6.0 * NODES)
        return np.hstack((np.zeros_like(peak), np.cumsum(pieces, axis=1)))


@dataclass(frozen=True, slots=True)
class HalfCycles:
    """Half-cycles on edges that yield, (n,) each."""

    edge: YieldingEdge
    p_rad_s: float
    alphas_rad: Floats
    sharp_peaks_rad: Floats
    """|θ| peaks that blocks on sharp edges have with the same energies."""
    peaks_rad: Floats
    quarters_s: Floats
    """Time from each peak to the impact after it."""
    delays_s: Floats
    """`YieldingEdge.delays`; (n, `NODES` + 1)."""

    @classmethod
    def on(
        cls, edge: YieldingEdge, p_rad_s: float, alphas_rad: Floats, sharp_peaks_rad: Floats
    ) -> HalfCycles:
        """Half-cycles with the energies that lead blocks on sharp edges to `sharp_peaks_rad`."""
        if edge.inset_rad == 0.0:
            quarters = exact_quarter_period(sharp_peaks_rad, p_rad_s, alphas_rad)
            none = np.zeros((sharp_peaks_rad.size, NODES + 1))
            return cls(edge, p_rad_s, alphas_rad, sharp_peaks_rad, sharp_peaks_rad, quarters, none)
        peaks = np.maximum(edge.peak(sharp_peaks_rad, alphas_rad), _LEAST_PEAK_RAD)
        delays = edge.delays(peaks, p_rad_s, alphas_rad)
        quarters = exact_quarter_period(peaks, p_rad_s, alphas_rad) + delays[:, -1]
        return cls(edge, p_rad_s, alphas_rad, sharp_peaks_rad, peaks, quarters, delays)

    def with_energy_times(self, factor: float) -> HalfCycles:
        """The same with this much of their energies."""
        energies = np.minimum(factor * exact_energy(self.sharp_peaks_rad, self.alphas_rad), OVERTURNED)
        sharp = exact_amplitude(energies, self.alphas_rad)
        return HalfCycles.on(self.edge, self.p_rad_s, self.alphas_rad, sharp)

    def rotation(self, index: NDArray[np.int_], time_from_peak_s: Floats) -> Floats:
        """|θ|, rad, at times from the peaks of the half-cycles `index`; of one shape.

        θ at t is θ on sharp edges at t less the delay at θ. What that differs by is expanded to the second
        power of the delay, a hundredth of the quarter at most: within 2e-7 rad.
        """
        peak, alpha = self.peaks_rad[index], self.alphas_rad[index]
        sharp, speed = half_cycle_rotation(time_from_peak_s, peak, self.p_rad_s, alpha)
        if self.edge.inset_rad == 0.0:
            return sharp
        side = np.sign(time_from_peak_s)
        delay = side * self._delay(index, sharp, peak)
        delay = side * self._delay(index, sharp - speed * delay, peak)
        deceleration = self.p_rad_s**2 * np.sin(alpha - sharp)
        return np.asarray(sharp - delay * (speed + 0.5 * deceleration * delay))

    def speed(self, index: NDArray[np.int_], rotation_rad: Floats) -> Floats:
        """|θ̇|, rad/s, of the half-cycles `index` at these |θ|; of one shape."""
        peak, alpha = self.peaks_rad[index], self.alphas_rad[index]
        # cos(α − θ_peak) − cos(α − θ) as a product: speeds near peaks lose no digits.
        middle, half = (peak + rotation_rad) / 2.0, (peak - rotation_rad) / 2.0
        sharp = 2.0 * np.sin(alpha - middle) * np.sin(half)
        taken = self.edge.work(self.peaks_rad)[index] - self.edge.work(rotation_rad)
        return np.asarray(self.p_rad_s * np.sqrt(2.0 * np.maximum(sharp - taken, 0.0)))

    def _delay(self, index: NDArray[np.int_], rotation_rad: Floats, peak_rad: Floats) -> Floats:
        """Seconds, by the straight line between the two nearest nodes."""
        place = NODES * np.sqrt(np.maximum(1.0 - rotation_rad / peak_rad, 0.0))
        node = np.minimum(place.astype(np.intp), NODES - 1)
        left = index * (NODES + 1) + node
        flat = self.delays_s.ravel()
        low = flat[left]
        return np.asarray(low + (place - node) * (flat[left + 1] - low))


@dataclass(frozen=True, slots=True)
class YieldingRocking:
    """A whole decaying motion on edges that yield.

    Held at the first peak until the release; after the last impact computed the wall lies still.
    """

    sharp: FreeRocking
    """The motion on sharp edges with the same energies: its speeds at the impacts are those on the strip."""
    half_cycles: HalfCycles
    """The release, then one after each impact; n_impacts + 1."""
    impacts_s: Floats
    """Times of the impacts; shape (n_impacts,)."""

    def locate(self, time_s: ArrayLike) -> tuple[NDArray[np.int_], Floats, Floats]:
        """(half-cycle, time from its peak in s, sign of θ) at each time, as `FreeRocking.locate` has them."""
        quarters = self.half_cycles.quarters_s
        return place_in_half_cycles(time_s, self.sharp.release_s, self.impacts_s, quarters, self.sharp.side)

    def at(self, time_s: ArrayLike) -> tuple[Floats, Floats]:
        """θ and θ̇ at any times, rad and rad/s, signed."""
        index, local, sign = self.locate(time_s)
        rotation = self.half_cycles.rotation(index, local)
        return sign * rotation, -sign * np.sign(local) * self.half_cycles.speed(index, rotation)

    def rotation(self, time_s: ArrayLike) -> Floats:
        """θ at any times, rad, signed."""
        index, local, sign = self.locate(time_s)
        return np.asarray(sign * self.half_cycles.rotation(index, local))


def free_rocking_on(
    edge: YieldingEdge,
    theta0_rad: float,
    restitution: ArrayLike,
    p_rad_s: float,
    alpha_rad: float,
    *,
    release_s: float = 0.0,
    max_impacts: int = 400,
    lean_rad: float = 0.0,
) -> YieldingRocking:
    """The motion after a release from rest at `theta0_rad` (either side) on edges that yield.

    `restitution` is one r, or one per impact, as in `free_rocking`, of speeds at θ = 0. A release within α
    from where edges that stand out overturn the wall is taken just short of there. `ValueError` for a
    release beyond α.
    """
    first_rad = alpha_rad + np.sign(theta0_rad) * lean_rad
    if abs(theta0_rad) >= first_rad:
        raise ValueError(f"the release rotation must lie below α = {first_rad:g} rad, not {theta0_rad:g}")
    taken = edge.work(theta0_rad) / (1.0 - np.cos(first_rad))
    energy = np.clip(exact_energy(theta0_rad, first_rad) - taken, _LEAST_ENERGY, OVERTURNED)
    sharp = free_rocking(
        float(np.sign(theta0_rad) * exact_amplitude(energy, first_rad)),
        restitution,
        p_rad_s,
        alpha_rad,
        release_s=release_s,
        smallest_peak_rad=0.0,
        max_impacts=max_impacts,
        lean_rad=lean_rad,
    )
    half_cycles = HalfCycles.on(edge, p_rad_s, sharp.alphas_rad, sharp.peaks_rad)
    return YieldingRocking(sharp, half_cycles, impact_times(release_s, half_cycles.quarters_s))

"""Event integration of one run: released, swing by swing, impact by impact, to rest.

A solver of SciPy with events for θ = 0 (impact) and ω = 0 (peak): every right-hand side is smooth within
a piece, also with friction that changes sign at the peak.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from daq_app.gap.blind.world.arrays import FloatArray
from daq_app.gap.blind.world.events.mechanics import Impact, Mechanics, Release
from daq_app.gap.blind.world.laboratories.numerics import Numerics

REST_RAD = 4e-5
"""A swing smaller than this is rest: half of what an LVDT's noise amounts to."""
LONGEST_S = 40.0
_ABSOLUTE_TO_RELATIVE = 1e-3
"""Absolute tolerance per relative one, rad: rotations of interest are 1e-3 and more."""
_DERIVATIVE_STEP_S = 2e-5
_AS_OWN = Numerics()


@dataclass(frozen=True, slots=True)
class Piece:
    """θ and ω of one half-swing, or of a wall that stands still."""

    start: float
    stop: float
    side: int
    state: Callable[[FloatArray], FloatArray] | None
    """(2, n) of times after release; None where θ = 0 and stays so."""


@dataclass(frozen=True, slots=True)
class ImpactRecord:
    """One impact as it happened: time after release, ω before and after, side the wall came from."""

    time: float
    before: float
    after: float
    side: int
    restitution: float


@dataclass(frozen=True, slots=True)
class Followed(ABC):
    """A motion that was followed to rest, however; times in seconds after the release."""

    release: Release
    impacts: tuple[ImpactRecord, ...]
    peaks: tuple[tuple[float, float], ...]
    """(time, θ) of the turning points after the release."""
    rest_s: float

    @abstractmethod
    def sample(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """θ, θ̇, θ̈ at rising times (n,); held before the release, at rest after the rest."""


@dataclass(frozen=True, slots=True)
class Motion(Followed):
    """The motion of one run, piece by piece."""

    pieces: tuple[Piece, ...]

    def sample(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        theta = np.where(time_s < 0.0, self.release.theta0, 0.0)
        omega = np.zeros_like(theta)
        alpha = np.zeros_like(theta)
        for piece in self.pieces:
            if piece.state is None:
                continue
            low, high = np.searchsorted(time_s, [piece.start, piece.stop])
            if low == high:
                continue
            t = time_s[low:high]
            theta[low:high], omega[low:high] = piece.state(t)
            h = _DERIVATIVE_STEP_S
            alpha[low:high] = (piece.state(t + h)[1] - piece.state(t - h)[1]) / (2.0 * h)
        return theta, omega, alpha


def integrate(mechanics: Mechanics, release: Release, numerics: Numerics = _AS_OWN) -> Motion:
    """Let the wall go at t = 0 and follow it to rest (at most 40 s)."""
    scatter = np.random.default_rng([release.seed, 1])
    pieces: list[Piece] = []
    impacts: list[ImpactRecord] = []
    peaks: list[tuple[float, float]] = []
    t, theta, omega = 0.0, release.theta0, release.omega0
    side = 1 if theta > 0 else -1
    mechanics.impacts_done = 0
    inward = omega * side <= 0.0
    while t < LONGEST_S:
        piece, t, theta, omega, reached = _half_swing(mechanics, numerics, t, theta, omega, side, inward)
        pieces.append(piece)
        if not reached:
            break
        if not inward:
            peaks.append((t, theta))
            omega = 0.0
            inward = True
            if abs(theta) < REST_RAD:
                break
            continue
        t, omega = _strike(mechanics, release, t, omega, side, scatter, pieces, impacts)
        side, theta, inward = -side, 0.0, False
    return Motion(release, tuple(impacts), tuple(peaks), t, tuple(pieces))


def _half_swing(
    mechanics: Mechanics,
    numerics: Numerics,
    t: float,
    theta: float,
    omega: float,
    side: int,
    inward: bool,
) -> tuple[Piece, float, float, float, bool]:
    """Integrate to upright (`inward`) or to the turning point; also says whether it was reached."""

    mechanics.heading = -side if inward else side

    def slope(time: float, y: FloatArray) -> tuple[float, float]:
        return y[1], mechanics.acceleration(time, y[0], y[1], side)

    def event(time: float, y: FloatArray) -> float:
        return float(y[0] * side if inward else y[1] * side)

    event.terminal = True  # type: ignore[attr-defined]
    event.direction = -1.0  # type: ignore[attr-defined]
    solved = solve_ivp(
        slope,
        (t, t + 5.0),
        (theta, omega),
        method=numerics.solver,
        events=event,
        dense_output=True,
        rtol=numerics.relative_tolerance,
        atol=_ABSOLUTE_TO_RELATIVE * numerics.relative_tolerance,
    )
    reached = solved.status == 1
    stop = float(solved.t[-1])
    return Piece(t, stop, side, solved.sol), stop, float(solved.y[0, -1]), float(solved.y[1, -1]), reached


def _strike(
    mechanics: Mechanics,
    release: Release,
    t: float,
    omega: float,
    side: int,
    scatter: np.random.Generator,
    pieces: list[Piece],
    impacts: list[ImpactRecord],
) -> tuple[float, float]:
    """The impact at θ = 0: time and ω with which the wall leaves it."""
    if mechanics.bounce_s > 0.0:
        # Thrown back onto the edge it came from for a short flight, then across with what r leaves.
        bounced, t_end = _bounce(mechanics, t, omega, side)
        pieces.append(bounced)
        impacts.append(ImpactRecord(t, omega, -_bounce_speed(mechanics, side, omega), side, 0.0))
        t = t_end
    elif mechanics.dwell_s > 0.0:
        pieces.append(Piece(t, t + mechanics.dwell_s, side, None))
        t += mechanics.dwell_s
    since = t - (impacts[-1].time if impacts else 0.0)
    seen = Impact(release.impacts_before + mechanics.impacts_done, abs(omega), side, since)
    epsilon = mechanics.wall.restitution_scatter * scatter.standard_normal()
    r = mechanics.restitution(seen, float(epsilon))
    after = r * omega
    impacts.append(ImpactRecord(t, omega, after, side, r))
    mechanics.impacts_done += 1
    return t, after


def _bounce_speed(mechanics: Mechanics, side: int, omega: float) -> float:
    """Signed speed away from upright that brings the wall back after `bounce_s` (constant moment)."""
    pull = abs(mechanics.acceleration(1e3, side * 1e-4, 0.0, side))
    return -side * min(0.5 * mechanics.bounce_s * pull, 0.5 * abs(omega))


def _bounce(mechanics: Mechanics, t: float, omega: float, side: int) -> tuple[Piece, float]:
    pull = abs(mechanics.acceleration(1e3, side * 1e-4, 0.0, side))
    away = abs(_bounce_speed(mechanics, side, omega))
    length = 2.0 * away / pull

    def flight(time: FloatArray) -> FloatArray:
        x = time - t
        return np.array([side * (away * x - 0.5 * pull * x * x), side * (away - pull * x)])

    return Piece(t, t + length, side, flight), t + length

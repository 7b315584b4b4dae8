"""The equation of motion, term by term, and the impact rule.

Everything works in folded coordinates of one half-cycle: side s = ±1, rotation q = s θ ≥ 0 and
speed v = q̇.  `setup` turns the parameter vector into the coefficients of the coming half-cycle;
`acceleration` is q̈.  A term is one line of `acceleration` and one of `setup`.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import G_M_S2
from sim_hardware.dynamics import parameters as par
from sim_hardware.jit import part

# coefficients of a half-cycle
C_STIFF: Final = 0  # g R_s / I_s
C_ALPHA: Final = 1  # α of this side, less the base's tilt
C_HALF: Final = 2  # g u / I
C_HEIGHT: Final = 3  # g h / I
C_TILT: Final = 4
C_WINKLER: Final = 5
C_VISCOUS: Final = 6
C_COULOMB: Final = 7
C_QUADRATIC: Final = 8
C_CUBIC: Final = 9
C_CABLE: Final = 10
C_SLACK: Final = 11
C_HOLD: Final = 12
C_HOLD_RATE: Final = 13
C_AMBIENT: Final = 14
C_AMBIENT_W: Final = 15
C_AMBIENT_PHASE: Final = 16
C_EDGE: Final = 17
C_EDGE_U: Final = 18
C_EDGE_H: Final = 19
C_GYRATION: Final = 20
C_PLAIN: Final = 21
C_RISING: Final = 22  # sign of v, for Coulomb friction
C_OPEN: Final = 23  # 1 beyond θc of the compliant joint
C_TAUT: Final = 24  # 1 beyond θs of the residual cable
C_HOLD_EVEN: Final = 25
C_HOLD_START: Final = 26  # time since the release, in units of 1/C_HOLD_RATE, at t = 0
C_STAY: Final = 27
C_STAY_LOOSE: Final = 28  # rotation at which the stay hangs loose; negative: it pulls to the other side
C_STAY_TAUT: Final = 29  # 1 while the stay pulls
N_COEFFICIENTS: Final = 30
_HOLDS: Final = 1e-6  # share of a holding force below which it is gone

_GAUSS_X: Final = (0.0469100770306680, 0.2307653449471585, 0.5, 0.7692346550528415, 0.9530899229693320)
_GAUSS_W: Final = (
    0.1184634425280945,
    0.2393143352496832,
    0.2844444444444444,
    0.2393143352496832,
    0.1184634425280945,
)


@part
def setup(
    vector: NDArray[np.float64], side: float, n_impacts: int, release_side: float, c: NDArray[np.float64]
) -> None:
    """Coefficients `c` of a half-cycle on `side` after `n_impacts` impacts of this test."""
    g = G_M_S2
    alpha, p, r0 = vector[par.ALPHA], vector[par.P], vector[par.R0]
    gyration = g * r0 / (p * p) - r0 * r0
    height = r0 * math.cos(alpha)
    half = r0 * math.sin(alpha) - vector[par.PIVOT_SHIFT] - side * vector[par.ECCENTRICITY]
    wear = 1.0 - vector[par.CRUSH_ALPHA] * 0.01 * (vector[par.IMPACTS_BEFORE] + n_impacts)
    if wear != 1.0 or vector[par.ALPHA_ASYMMETRY] != 0.0:
        half = height * math.tan(math.atan(half / height) * wear + side * vector[par.ALPHA_ASYMMETRY])
    inertia = gyration + half * half + height * height
    c[C_STIFF] = g * math.sqrt(half * half + height * height) / inertia
    c[C_TILT] = side * vector[par.BASE_TILT]
    c[C_ALPHA] = math.atan2(half, height) - c[C_TILT]
    c[C_HALF] = g * half / inertia
    c[C_HEIGHT] = g * height / inertia
    c[C_WINKLER] = vector[par.WINKLER]
    c[C_VISCOUS] = 2.0 * vector[par.ZETA] * p
    c[C_COULOMB] = vector[par.COULOMB] * p * p * alpha
    c[C_QUADRATIC] = vector[par.QUADRATIC]
    c[C_CUBIC] = vector[par.CUBIC] * p * p / (alpha * alpha)
    c[C_CABLE] = vector[par.CABLE] * p * p if side == release_side else 0.0
    c[C_SLACK] = vector[par.CABLE_SLACK]
    c[C_STAY] = vector[par.STAY] * p * p
    c[C_STAY_LOOSE] = side * (vector[par.STAY_LOOSE] + release_side * vector[par.STAY_RELEASE])
    c[C_HOLD] = 0.0
    c[C_HOLD_RATE] = 0.0
    c[C_HOLD_EVEN] = 0.0
    c[C_HOLD_START] = 0.0
    c[C_AMBIENT] = -side * vector[par.AMBIENT] / g * c[C_STIFF]
    c[C_AMBIENT_W] = 2.0 * math.pi * vector[par.AMBIENT_HZ]
    c[C_AMBIENT_PHASE] = vector[par.AMBIENT_PHASE]
    c[C_EDGE] = vector[par.EDGE_RADIUS]
    c[C_EDGE_U] = half - vector[par.EDGE_RADIUS]
    c[C_EDGE_H] = height - vector[par.EDGE_RADIUS]
    c[C_GYRATION] = gyration
    plain = c[C_WINKLER] == 0.0 and c[C_EDGE] == 0.0 and c[C_AMBIENT] == 0.0 and c[C_CABLE] == 0.0
    plain = plain and c[C_VISCOUS] == 0.0 and c[C_COULOMB] == 0.0 and c[C_QUADRATIC] == 0.0
    c[C_PLAIN] = 1.0 if plain and c[C_CUBIC] == 0.0 and c[C_STAY] == 0.0 else 0.0


@part
def set_region(c: NDArray[np.float64], q: float, rising: bool) -> None:
    """Fix which smooth branch holds for the step that starts at `q`.

    On a threshold the direction of travel decides: the branch must be the one the step runs into.
    """
    c[C_RISING] = 1.0 if rising else -1.0
    c[C_OPEN] = 1.0 if q > c[C_WINKLER] or (rising and q == c[C_WINKLER]) else 0.0
    c[C_TAUT] = 1.0 if q > c[C_SLACK] or (rising and q == c[C_SLACK]) else 0.0
    slack = c[C_STAY_LOOSE]
    c[C_STAY_TAUT] = 1.0 if slack < 0.0 or q < slack or (not rising and q == slack) else 0.0


@part
def sine(x: float) -> float:
    """sin x to machine precision, twice as fast as the library's at the angles of a rocking wall."""
    if abs(x) > 0.8:
        return math.sin(x)
    y = x * x
    y2 = y * y
    low = (-1.0 / 6.0 + y * (1.0 / 120.0)) + (-1.0 / 5040.0 + y * (1.0 / 362880.0)) * y2
    high = (-1.0 / 39916800.0 + y * (1.0 / 6227020800.0)) - y2 * (1.0 / 1307674368000.0)
    return x + x * y * (low + high * (y2 * y2))


@part
def _restoring(q: float, v: float, c: NDArray[np.float64]) -> float:
    """q̈ of gravity alone: sharp edge, rounded edge or compliant joint."""
    if c[C_EDGE] > 0.0:
        # rolling on an edge of radius ρ: I_C q̈ = −arm (g + ρ v²), contact below the centre of the circle
        sin, cos = math.sin(q), math.cos(q)
        rho, u, h = c[C_EDGE], c[C_EDGE_U], c[C_EDGE_H]
        inertia = c[C_GYRATION] + u * u + h * h + rho * rho + 2.0 * rho * (u * sin + h * cos)
        arm = u * math.cos(q + c[C_TILT]) - h * math.sin(q + c[C_TILT])
        return float(-(arm * G_M_S2 + (u * cos - h * sin) * rho * v * v) / inertia)
    if c[C_WINKLER] > 0.0:
        factor = q / (3.0 * c[C_WINKLER])
        if c[C_OPEN] > 0.0:
            factor = 1.0 - 2.0 / 3.0 * math.sqrt(c[C_WINKLER] / max(q, 1e-30))
        tilted = q + c[C_TILT]
        return float(-(c[C_HALF] * factor * math.cos(tilted) - c[C_HEIGHT] * math.sin(tilted)))
    return float(-c[C_STIFF] * sine(c[C_ALPHA] - q))


@part
def _held_share(x: float, even: float) -> float:
    """(1 − e x)^(1/e): exp(−x) for e = 0, a force that falls evenly to nothing for e = 1."""
    if even < 1e-6:
        return math.exp(-x)
    left = even * x
    return math.exp(math.log1p(-left) / even) if left < 1.0 else 0.0


@part
def acceleration(q: float, v: float, t: float, c: NDArray[np.float64]) -> float:
    """q̈, rad/s², at q, rad, and v, rad/s, in the branch that `set_region` fixed; `c` (N_COEFFICIENTS,)."""
    if c[C_PLAIN] > 0.0:
        return float(-c[C_STIFF] * sine(c[C_ALPHA] - q))
    a = _restoring(q, v, c) - c[C_VISCOUS] * v - c[C_QUADRATIC] * v * abs(v) - c[C_COULOMB] * c[C_RISING]
    a -= c[C_CUBIC] * q * q * q
    if c[C_CABLE] > 0.0 and c[C_TAUT] > 0.0:
        a -= c[C_CABLE] * (q - c[C_SLACK])
    if c[C_STAY] > 0.0 and c[C_STAY_TAUT] > 0.0:
        a -= c[C_STAY] * (q - c[C_STAY_LOOSE])
    if c[C_AMBIENT] != 0.0:
        forcing = math.sin(c[C_AMBIENT_W] * t + c[C_AMBIENT_PHASE])
        a += c[C_AMBIENT] * forcing * math.cos(c[C_ALPHA] - q)
    if c[C_HOLD] > 0.0 or c[C_HOLD] < 0.0 < c[C_RISING] * c[C_HOLD_RATE]:
        a += c[C_HOLD] * _held_share(c[C_HOLD_START] + t * c[C_HOLD_RATE], c[C_HOLD_EVEN])
    return float(a)


@part
def hold_back(vector: NDArray[np.float64], q: float, c: NDArray[np.float64]) -> None:
    """Slow release: the force that held the wall at `q` dies away with the mean time τ, not at once."""
    if vector[par.SLOW_RELEASE] > 0.0:
        set_region(c, q, False)
        c[C_HOLD] = max(-_restoring(q, 0.0, c), 0.0)
        c[C_HOLD_EVEN] = vector[par.RELEASE_EVEN]
        c[C_HOLD_RATE] = 1.0 / (vector[par.SLOW_RELEASE] * (1.0 + c[C_HOLD_EVEN]))
        c[C_PLAIN] = 0.0


@part
def hold_on(
    vector: NDArray[np.float64],
    held: float,
    begin: float,
    later: float,
    back_from: float,
    c: NDArray[np.float64],
) -> None:
    """What is left of the holding force after the first impact, at `begin`, until the wall turns back.

    It is a rope that is paid out: it pulls the wall back while that goes on, and is slack when it returns.
    `held`: what `hold_back` found. `later`: how long after the release the time is zero. `back_from`: the
    time from which time runs backwards; negative: it does not.
    """
    if held == 0.0:
        return
    even = vector[par.RELEASE_EVEN]
    rate = 1.0 / (vector[par.SLOW_RELEASE] * (1.0 + even))
    if _held_share(max(begin + later, 0.0) * rate, even) < _HOLDS:
        return
    c[C_HOLD], c[C_HOLD_EVEN], c[C_PLAIN] = -held, even, 0.0
    c[C_HOLD_START] = (later if back_from < 0.0 else later + 2.0 * back_from) * rate
    c[C_HOLD_RATE] = rate if back_from < 0.0 else -rate


@part
def work_to(q: float, c: NDArray[np.float64]) -> float:
    """Work per inertia (rad²/s²) against gravity from upright to `q`, by five-point Gauss quadrature."""
    total = 0.0
    for k in range(5):
        x = q * _GAUSS_X[k]
        set_region(c, x, True)
        total -= _GAUSS_W[k] * _restoring(x, 0.0, c)
    return float(total * q)


@part
def uneven_impact(vector: NDArray[np.float64]) -> float:
    """What a plastic impact that ends a swing to +x takes beyond the mean of both sides, relative to r.

    r of a plastic impact goes with 1/(I_G + m (h² + u²)), u the lever of the edge that the wall comes down
    on; m/I_O = p²/(g R). To first order in the difference of the levers.
    """
    alpha, p = vector[par.ALPHA], vector[par.P]
    eccentricity = vector[par.ECCENTRICITY] - vector[par.ALPHA_ASYMMETRY] * vector[par.R0] / math.cos(alpha)
    return float(2.0 * eccentricity * p * p * math.sin(alpha) / G_M_S2)


@part
def restitution(vector: NDArray[np.float64], speed: float, side: float, n: int, deviate: float) -> float:
    """r of the n-th impact (from 0) that ends a swing on `side` with `speed` > 0; kept within 0 … 1."""
    r = vector[par.RESTITUTION] + vector[par.R_SLOPE] * (speed - vector[par.R_SLOPE_SPEED])
    r += side * vector[par.R_ASYMMETRY]
    r *= 1.0 - side * vector[par.UNEVEN_IMPACT] * uneven_impact(vector)
    r *= 1.0 - vector[par.CRUSH_R] * 0.01 * (vector[par.IMPACTS_BEFORE] + n)
    r *= 1.0 + vector[par.SCATTER] * deviate
    return float(min(max(r, 0.0), 1.0))

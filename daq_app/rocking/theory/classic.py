"""Classic (linearised) rocking theory of a rigid block: closed forms of the paper, vectorised.

Equation numbers are those of Costa et al., "Free rocking tests on stone masonry wallettes".
Everything here belongs to the *linearised* equation θ̈ = p²(θ − α·sgn θ); the exact counterparts
for θ̈ = −p² sin(α·sgn θ − θ) live in `daq_app.rocking.theory.housner` and are never mixed in silently.
All functions take scalars or arrays that broadcast, and return that shape. Amplitudes are given as
φ = |θ_peak| / α. r is a ratio of angular velocities, the energy ratio is r².
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def _out(value: ArrayLike) -> Floats:
    """Float64 array; scalars come out as NumPy scalars, which behave as `float`."""
    result: Floats = np.asarray(value, dtype=np.float64)[()]
    return result


def _checked(
    name: str, value: ArrayLike, low: float, high: float, *, low_open: bool, high_open: bool
) -> Floats:
    """`value` as float64, or `ValueError` saying which values would be right."""
    array = np.asarray(value, dtype=np.float64)
    below = array <= low if low_open else array < low
    above = array >= high if high_open else array > high
    if np.any(below | above | ~np.isfinite(array)):
        left, right = "(" if low_open else "[", ")" if high_open else "]"
        bad = array[below | above | ~np.isfinite(array)].flat[0] if array.ndim else array
        raise ValueError(f"{name} must lie in {left}{low:g}, {high:g}{right}, not {float(bad):g}")
    return array


def _positive(name: str, value: ArrayLike) -> Floats:
    return _checked(name, value, 0.0, np.inf, low_open=True, high_open=True)


def _phi(value: ArrayLike) -> Floats:
    return _checked("the amplitude φ = θ/α", value, 0.0, 1.0, low_open=False, high_open=True)


def _restitution(value: ArrayLike) -> Floats:
    return _checked("the coefficient of restitution r", value, 0.0, 1.0, low_open=True, high_open=False)


def _alpha(value: ArrayLike) -> Floats:
    return _checked("the angle α in radians", value, 0.0, np.pi / 2, low_open=True, high_open=True)


def _count(value: ArrayLike) -> Floats:
    array = np.asarray(value, dtype=np.float64)
    if np.any((array < 0) | (array != np.floor(array))):
        raise ValueError("the number of impacts n must be a whole number, 0 or more")
    return array


def frequency_parameter(weight_n: ArrayLike, r0_m: ArrayLike, inertia_kg_m2: ArrayLike) -> Floats:
    """p = √(W R / I_O), rad/s (below Eqn 2.1)."""
    value = np.sqrt(
        _positive("the weight in newtons", weight_n)
        * _positive("the radius R in metres", r0_m)
        / _positive("the inertia I_O in kg m²", inertia_kg_m2)
    )
    return _out(value)


def r_max_rectangular(alpha_rad: ArrayLike) -> Floats:
    """Upper bound 1 − 3/2 sin²α of a homogeneous rectangular block (1.2)."""
    return _out(1.0 - 1.5 * np.sin(_alpha(alpha_rad)) ** 2)


def r_max_block(
    mass_kg: ArrayLike, r0_m: ArrayLike, inertia_kg_m2: ArrayLike, alpha_rad: ArrayLike
) -> Floats:
    """Upper bound 1 − 2 m R² sin²α / I_O of any symmetric block.

    Angular momentum about the new corner is kept through the impact; with I_O = 4/3 m R² this is (1.2).
    """
    ratio = _positive("the mass in kg", mass_kg) * _positive("the radius R in metres", r0_m) ** 2
    ratio = ratio / _positive("the inertia I_O in kg m²", inertia_kg_m2)
    return _out(1.0 - 2.0 * ratio * np.sin(_alpha(alpha_rad)) ** 2)


def energy(phi: ArrayLike) -> Floats:
    """E = 1 − (1 − φ)²: energy of amplitude φ as a fraction of the overturning barrier, linearised."""
    value = _phi(phi)
    return _out(value * (2.0 - value))


def amplitude_of_energy(energy_ratio: ArrayLike) -> Floats:
    """φ = 1 − √(1 − E), the inverse of `energy` (the outer part of 4.3)."""
    value = _checked("the energy E", energy_ratio, 0.0, 1.0, low_open=False, high_open=True)
    return _out(value / (1.0 + np.sqrt(1.0 - value)))


def period(phi: ArrayLike, p_rad_s: ArrayLike) -> Floats:
    """Full period T = (4/p) acosh(1/(1−φ)) in s at constant amplitude φ (4.1)."""
    value = _phi(phi)
    return _out(
        4.0 / _positive("the parameter p in rad/s", p_rad_s) * np.arctanh(np.sqrt(value * (2.0 - value)))
    )


def impact_speed(phi: ArrayLike, p_rad_s: ArrayLike, alpha_rad: ArrayLike) -> Floats:
    """|θ̇| = p α √E in rad/s with which the half-cycle of peak φ starts and ends, linearised."""
    speed = (
        _positive("the parameter p in rad/s", p_rad_s) * _alpha(alpha_rad) * np.sqrt(np.asarray(energy(phi)))
    )
    return _out(speed)


def energy_after(n: ArrayLike, phi0: ArrayLike, r: ArrayLike) -> Floats:
    """E_n = r^{2n} E_0 after `n` impacts from a release at amplitude `phi0`."""
    return _out(_restitution(r) ** (2.0 * _count(n)) * np.asarray(energy(phi0)))


def period_after(n: ArrayLike, phi0: ArrayLike, r: ArrayLike, p_rad_s: ArrayLike) -> Floats:
    """T_n = (4/p) atanh √(r^{2n}[1−(1−φ0)²]) in s (4.2)."""
    root = np.sqrt(np.asarray(energy_after(n, phi0, r)))
    return _out(4.0 / _positive("the parameter p in rad/s", p_rad_s) * np.arctanh(root))


def amplitude_after(n: ArrayLike, phi0: ArrayLike, r: ArrayLike) -> Floats:
    """φ_n, the peak of the half-cycle that FOLLOWS impact `n` (4.3)."""
    return amplitude_of_energy(energy_after(n, phi0, r))


def impacts_until(phi_end: float, phi0: float, r: float) -> int:
    """Number of impacts after which the amplitude is below `phi_end`; needs r < 1."""
    if not phi_end > 0.0:
        raise ValueError(f"the end amplitude must be positive, not {phi_end:g}")
    if r >= 1.0:
        raise ValueError("with r = 1 the motion never decays: give r < 1")
    start, end = float(np.asarray(energy(phi0))), float(np.asarray(energy(phi_end)))
    _restitution(r)
    if end > start:
        return 0
    n = max(int(np.floor(np.log(end / start) / (2.0 * np.log(r)))), 0)
    while float(np.asarray(amplitude_after(n, phi0, r))) >= phi_end:
        n += 1
    return n


def time_to_decay(phi_end: float, phi0: float, r: float, p_rad_s: float) -> float:
    """Time in s from the release to the end of the first half-cycle whose peak is below `phi_end`."""
    return time_of_impact(impacts_until(phi_end, phi0, r) + 1, phi0, r, p_rad_s)


def time_of_impact(n: int, phi0: float, r: float, p_rad_s: float) -> float:
    """Time in s from the release at `phi0` to impact `n` (n ≥ 1): T_0/4 + Σ T_k/2, k = 1 … n−1."""
    if n < 1:
        raise ValueError(f"impacts are counted from 1, not {n}")
    periods = np.asarray(period_after(np.arange(n), phi0, r, p_rad_s))
    return float(periods[0] / 4.0 + periods[1:].sum() / 2.0)


def restitution_from_speeds(speed_n: ArrayLike, speed_n_plus_2: ArrayLike) -> Floats:
    """EAV, r = √(|θ̇_{n+2}| / |θ̇_n|) from the peak speeds of two impacts on the same side (4.4)."""
    first = _positive("the speed at impact n", np.abs(np.asarray(speed_n, dtype=np.float64)))
    second = _positive("the speed at impact n + 2", np.abs(np.asarray(speed_n_plus_2, dtype=np.float64)))
    return _out(np.sqrt(second / first))


def restitution_from_peaks(phi0: ArrayLike, phi_n: ArrayLike, n: ArrayLike) -> Floats:
    """CRT, r = (E_n / E_0)^{1/(2n)} from the release amplitude and the peak after impact n (4.5)."""
    count = _count(n)
    if np.any(count < 1):
        raise ValueError("CRT needs at least one impact between the two peaks")
    start = _positive("the energy of the release amplitude", energy(phi0))
    return _out((np.asarray(energy(np.abs(phi_n))) / start) ** (1.0 / (2.0 * count)))

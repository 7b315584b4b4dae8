"""What people do with the wall before and after a test: pulling, holding, letting down, footsteps.

Paths are smooth: rotation, velocity and acceleration are continuous, in quintic pieces.  Every
choice comes from a generator that the caller seeds.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_hardware.dynamics import pieces as pc
from sim_hardware.sensors import Knock

KNOT_S: Final = 0.025
_HOLD_PATH_S: Final = 20.0
"""After this the held wall no longer moves measurably."""

Path = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Times → (3, n): rotation, velocity, acceleration."""


def quintic_pieces(knots_s: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n − 1, 19) pieces through (3, n) rotations, velocities and accelerations at the knots."""
    h = np.diff(knots_s)
    q0, q1 = values[0, :-1], values[0, 1:]
    v0, v1 = values[1, :-1] * h, values[1, 1:] * h
    a0, a1 = values[2, :-1] * h**2, values[2, 1:] * h**2
    d = q1 - q0
    rows = np.zeros((len(h), pc.N_COLUMNS))
    rows[:, pc.START], rows[:, pc.SCALE], rows[:, pc.SIDE] = knots_s[:-1], h, np.sign(q0 + q1)
    coefficients = (
        q0,
        v0,
        0.5 * a0,
        10 * d - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1,
        -15 * d + 8 * v0 + 7 * v1 + 1.5 * a0 - a1,
        6 * d - 3 * (v0 + v1) + 0.5 * (a1 - a0),
    )
    for k, coefficient in enumerate(coefficients):
        rows[:, pc.ROTATION + k] = coefficient
        if k:
            rows[:, pc.VELOCITY + k - 1] = k * coefficient / h
    return rows


def _minimum_jerk(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, n): 0 → 1 over 0 ≤ x ≤ 1 with no velocity or acceleration at the ends, and its derivatives."""
    x = np.clip(x, 0.0, 1.0)
    return np.stack(
        [
            x**3 * (10 - 15 * x + 6 * x**2),
            30 * x**2 * (1 - x) ** 2,
            60 * x * (1 - x) * (1 - 2 * x),
        ]
    )


def _wobble(
    t: NDArray[np.float64], rms_rad: float, frequencies_hz: NDArray[np.float64], phases: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(3, n) sum of sinusoids with the given rms."""
    w = 2 * np.pi * frequencies_hz[:, None]
    amplitude = rms_rad * np.sqrt(2.0 / len(frequencies_hz))
    argument = w * t + phases[:, None]
    return np.stack(
        [
            amplitude * np.sin(argument).sum(axis=0),
            amplitude * (w * np.cos(argument)).sum(axis=0),
            -amplitude * (w**2 * np.sin(argument)).sum(axis=0),
        ]
    )


def _times_envelope(wave: NDArray[np.float64], envelope: NDArray[np.float64]) -> NDArray[np.float64]:
    """Product of two (3, n) functions with its derivatives."""
    f, g = wave, envelope
    return np.stack([f[0] * g[0], f[1] * g[0] + f[0] * g[1], f[2] * g[0] + 2 * f[1] * g[1] + f[0] * g[2]])


def pull_path(
    start_s: float, from_rad: float, to_rad: float, pull_s: float, rng: np.random.Generator
) -> tuple[NDArray[np.float64], list[Knock]]:
    """Pieces and knocks of a pull by a hand winch that ends held at `to_rad`, from a wall at rest.

    The wall goes in a few strokes with a wobble of up to some milliradians, the cable jerks, and
    after the pull the wobble and a creep of a few hundredths of a milliradian die away.
    """
    strokes = int(rng.integers(3, 7))
    shares = np.concatenate([[0.0], np.cumsum(rng.dirichlet(np.full(strokes, 12.0)))])
    starts = np.arange(strokes) * pull_s / strokes
    wobble = 0.02 * abs(to_rad - from_rad) * rng.uniform(0.5, 1.0)
    frequencies, phases = rng.uniform(0.7, 3.5, 5), rng.uniform(0.0, 2 * np.pi, 5)
    creep = rng.uniform(-3e-5, 3e-5)
    end = pull_s + _HOLD_PATH_S
    t = np.arange(0.0, end + KNOT_S / 2, KNOT_S)
    path = np.zeros((3, t.size))
    path[0] = from_rad
    for k in range(strokes):
        length = 0.9 * pull_s / strokes
        part = _minimum_jerk((t - starts[k]) / length) * (to_rad - from_rad) * (shares[k + 1] - shares[k])
        path += part / np.array([[1.0], [length], [length**2]])
    # the wobble rises with the first stroke and dies away after the pull
    rise = _minimum_jerk(t / (0.3 * pull_s)) / np.array([[1.0], [0.3 * pull_s], [(0.3 * pull_s) ** 2]])
    late = np.maximum(t - pull_s, 0.0)
    fade = np.where(late > 0, np.exp(-((late / 1.5) ** 2)), 1.0)
    envelope = np.stack(
        [fade, -2 * late / 1.5**2 * fade, (4 * late**2 / 1.5**4 - 2 / 1.5**2 * (late > 0)) * fade]
    )
    path += _times_envelope(_times_envelope(_wobble(t, wobble, frequencies, phases), rise), envelope)
    settle = np.exp(-late / 3.0)
    moving = (late > 0) * creep
    path += np.stack([moving * (1 - settle - late / 3.0 * settle), moving * late / 9.0 * settle, 0 * t])
    path[1:, -1] = 0.0
    rows = quintic_pieces(start_s + t, path)
    rows = np.concatenate([rows, pc.constant_piece(start_s + end, path[0, -1])[None, :]])
    jerks = start_s + np.concatenate([starts, [pull_s]]) + rng.uniform(0.0, 0.05, strokes + 1)
    knocks = [Knock(float(at), float(rng.uniform(0.005, 0.06))) for at in jerks]
    return rows, knocks


def footsteps(start_s: float, end_s: float, rng: np.random.Generator) -> list[Knock]:
    """People walking about: faint knocks, about one in a second and a half."""
    n = int(rng.poisson(max(end_s - start_s, 0.0) / 1.5))
    times = np.sort(rng.uniform(start_s, end_s, n))
    return [Knock(float(t), float(rng.uniform(0.0005, 0.004))) for t in times]


def lower_path(
    start_s: float, state: tuple[float, float, float], target_rad: float, duration_s: float
) -> NDArray[np.float64]:
    """Pieces from the state (θ, θ̇, θ̈) at `start_s` to rest at `target_rad`."""
    knots = np.array([start_s, start_s + duration_s])
    values = np.array([[state[0], target_rad], [state[1], 0.0], [state[2], 0.0]])
    rows = quintic_pieces(knots, values)
    return np.concatenate([rows, pc.constant_piece(start_s + duration_s, target_rad)[None, :]])

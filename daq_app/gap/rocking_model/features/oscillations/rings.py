"""Ring-down after impacts: does the wall bend or turn as an oscillator that every impact kicks?

One oscillator is fitted to all runs (its frequency and damping, by a scan); each signal then has two
coefficients per run, of the sine and the cosine of the ring-down per jump of the angular velocity.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core.features import FloatArray, independent_fraction, robust_sd
from daq_app.gap.rocking_model.features.block import Block, Shares
from daq_app.gap.rocking_model.features.noise import nats_explained
from daq_app.gap.rocking_model.features.oscillations.ring_signals import Signal
from daq_app.gap.rocking_model.features.response import resonator
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ
from daq_app.gap.rocking_model.tolerances.walls import (
    OSCILLATION_INDEPENDENT,
    RING_SD,
    SCANNED_INDEPENDENT,
    SURE_DAMPING,
    VAGUE_DAMPING,
    VAGUE_FREQUENCY,
)
from daq_app.rocking.geometry.parabola import vertex

ComplexArray = NDArray[np.complex128]
_Bases = list[tuple[NDArray[np.intp], FloatArray]]
"""Samples, (n,), and what is removed from a signal there: orthonormal columns, (n, k)."""
BEND_HZ = np.geomspace(2.0, 42.0, 61)
TURN_HZ = np.geomspace(1.5, 14.0, 40)
DAMPING = (0.01, 0.04)
FINE_DAMPING = (0.007, 0.012, 0.02, 0.032, 0.05, 0.08)
_DEGREE = 4
_OTHER_DAMPING = (1.1, 1.0 / 1.1)
"""Factors of the damping between which the size of a ring-down says how it follows ln ζ."""


@dataclass(frozen=True, slots=True)
class Ring:
    """The oscillator that fits best, and how well: gain in log likelihood over no ring-down."""

    frequency_hz: float
    zeta: float
    gain: float
    frequency_sd: float
    zeta_sd: float
    """Relative."""

    @property
    def decays(self) -> bool:
        """Whether the runs say how fast; what follows no impact has no damping to speak of."""
        return self.zeta_sd < VAGUE_DAMPING


def ring_columns(grid: Grid, frequency_hz: float, zeta: float) -> FloatArray:
    """Sine and cosine of the ring-down per unit jump of θ̇, shape (m, 2)."""
    waves = ring_waves(grid, np.array([frequency_hz]), np.array([zeta]))
    return np.hstack([waves.imag, waves.real])


def ring_waves(grid: Grid, frequencies_hz: FloatArray, zetas: FloatArray) -> ComplexArray:
    """Ring-downs of oscillators, (k,) each, per unit jump of θ̇, shape (m, k): cosine + i sine.

    Between two impacts each sample is the one before times exp(rate · interval of the grid), so that all
    half-cycles share the powers of that.
    """
    natural = 2.0 * np.pi * frequencies_hz
    rates = -zetas * natural + 1j * natural * np.sqrt(1.0 - zetas**2)
    first = np.minimum(np.searchsorted(grid.time_s, grid.impact_s), grid.time_s.size - 1)
    last = np.searchsorted(grid.impact_s, grid.time_s, side="right")
    # What is left of all jumps so far, at the first sample after each impact; nothing before the first.
    states = np.zeros((grid.impact_s.size + 1, rates.size), dtype=complex)
    left = np.zeros_like(rates)
    for k, (jump, time) in enumerate(zip(grid.jumps, grid.impact_s, strict=True)):
        left = left * np.exp(rates * (time - grid.impact_s[max(k - 1, 0)])) + jump
        states[k + 1] = left * np.exp(rates * (grid.time_s[first[k]] - time))
    since = np.arange(grid.time_s.size) - np.concatenate([[0], first])[last]
    since[last == 0] = 0
    interval = float(grid.time_s[1] - grid.time_s[0])
    powers = np.exp(interval * np.arange(since.max() + 1)[:, None] * rates)
    return np.asarray(states[last] * powers[since])


def forced_column(grid: Grid, frequency_hz: float, zeta: float, *, accelerations: bool) -> FloatArray:
    """Ring of a wall whose own inertia bends it, beyond what the jumps of θ̇ do, (m,): ω q, or ω q̈.

    q̈ + 2 ζ ω q̇ + ω² q = θ̈ with θ̈ as it is between impacts; its sign changes at each, from which such a wall
    rings as well. The displacement keeps its slow part.
    """
    natural = 2.0 * np.pi * frequency_hz
    place = resonator(grid.alpha, natural, zeta) / natural
    if not accelerations:
        return place
    speed = np.gradient(place, 1.0 / GRID_HZ)
    return np.asarray(natural * (grid.alpha - 2.0 * zeta * speed - natural * place))


def cleaner(grid: Grid, pick: NDArray[np.bool_], slow: bool) -> _Bases:
    """Bases to be removed from a signal: smooth curves between impacts, or the rotation for slow turns.

    None for a signal of which nothing is picked: where every impact lasts, little lies between them.
    """
    places = np.flatnonzero(pick)
    if not places.size:
        return []
    if slow:
        t = grid.time_s[places]
        columns = np.column_stack(
            [np.ones_like(t), t, grid.theta[places], grid.theta[places] ** 2, np.abs(grid.theta[places])]
        )
        return [(places, np.linalg.qr(columns / (np.abs(columns).max(axis=0) + 1e-30))[0])]
    bases = []
    edges = np.searchsorted(grid.time_s[places], grid.impact_s)
    for start, stop in itertools.pairwise([*edges, places.size]):
        part = places[start:stop]
        if part.size > 2 * _DEGREE + 4:
            bases.append((part, _smooth_curves(part.size)))
    return bases


@lru_cache(maxsize=1024)
def _smooth_curves(count: int) -> FloatArray:
    """Orthonormal polynomials over evenly spaced samples, (count, degree + 1)."""
    return np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, count), _DEGREE + 1))[0]


def _clean(values: FloatArray, bases: _Bases) -> FloatArray:
    """What the bases leave of the columns of `values` (m, k), at their samples."""
    parts = [values[part] - basis @ (basis.T @ values[part]) for part, basis in bases]
    return np.concatenate(parts) if parts else values[:0]


def scan(grids: Sequence[Grid], signals: Sequence[list[Signal]], *, slow: bool) -> Ring | None:
    """The oscillator that all runs and signals agree on best; None where there is nothing to scan."""
    coarse_hz = TURN_HZ if slow else BEND_HZ
    seen = [(grid, _cleaned(grid, listed, slow)) for grid, listed in zip(grids, signals, strict=True)]
    score = _score(seen, coarse_hz, DAMPING)
    if not np.any(score > 0.0):
        return None
    i, _ = np.unravel_index(int(np.argmax(score)), score.shape)
    # A lightly damped ring is sharper than the first scan's steps.
    step = float(coarse_hz[1] / coarse_hz[0])
    fine_hz = coarse_hz[i] * np.geomspace(1.0 / step, step, 25)
    score = _score(seen, fine_hz, FINE_DAMPING)
    k, j = np.unravel_index(int(np.argmax(score)), score.shape)
    spacing = float(np.log(fine_hz[1] / fine_hz[0]))
    along, bend = _vertex(score[:, j], int(k))
    frequency = float(fine_hz[0] * np.exp(spacing * along))
    sd = frequency * spacing / np.sqrt(max(bend, 0.05))
    # A damping between the steps would leave the ring too small: its size follows the damping.
    zetas = FINE_DAMPING[int(j)] * np.geomspace(1.0 / 1.7, 1.7, 13)
    score = _score(seen, np.array([frequency]), list(zetas))[0]
    across, bend = _vertex(score, int(np.argmax(score)))
    spacing = float(np.log(zetas[1] / zetas[0]))
    zeta = float(zetas[0] * np.exp(spacing * np.clip(across, 0.0, zetas.size - 1.0)))
    zeta_sd = spacing / np.sqrt(max(bend, 1e-9))
    return Ring(
        frequency,
        zeta,
        float(score.max()),
        float(min(sd, VAGUE_FREQUENCY * frequency)),
        float(np.clip(zeta_sd, SURE_DAMPING, VAGUE_DAMPING)),
    )


def _vertex(values: FloatArray, k: int) -> tuple[float, float]:
    """(place, −second difference) of the top of a sampled curve near its sample `k`."""
    inner, shift, bend = vertex(values, k)
    if bend > -1e-9:
        return float(k), 0.0
    return inner + float(np.clip(shift, -1.0, 1.0)), -bend


def _cleaned(grid: Grid, signals: Sequence[Signal], slow: bool) -> list[tuple[FloatArray, _Bases]]:
    """What the bases leave of each signal that is long enough, (n,), and these bases."""
    seen = []
    for signal in signals:
        if signal.pick.sum() < 100:
            continue
        bases = cleaner(grid, signal.pick, slow)
        values = _clean(signal.values[:, None], bases)[:, 0]
        if values.size >= 60:
            seen.append((values, bases))
    return seen


def _score(
    seen: Sequence[tuple[Grid, list[tuple[FloatArray, _Bases]]]],
    frequencies: FloatArray,
    damping: Sequence[float],
) -> FloatArray:
    """Gain in log likelihood over all runs and their clean signals, (frequencies, damping)."""
    score = np.zeros((frequencies.size, len(damping)))
    both = np.meshgrid(frequencies, damping, indexing="ij")
    for grid, signals in seen:
        if not signals:
            continue
        waves = ring_waves(grid, both[0].ravel(), both[1].ravel())
        for values, bases in signals:
            score += _gains(values, waves, bases).reshape(score.shape)
    return score


def _gains(values: FloatArray, waves: ComplexArray, bases: _Bases) -> FloatArray:
    """Gain in log likelihood of sine and cosine of each wave (m, k); residuals' correlation is allowed for.

    `values` (n,) are free of the bases. What these leave of a wave is not worked out: its products are
    the wave's own less those of its coefficients, and its product with the values is the wave's.
    """
    count = waves.shape[1]
    squares, along = np.zeros(2 * count), np.zeros(2 * count)
    crossed = np.zeros(count)
    start = 0
    for part, basis in bases:
        wave = waves[_span(part)].view(np.float64)  # cosine and sine take turns
        squares += np.einsum("nk,nk->k", wave, wave)
        crossed += np.einsum("nk,nk->k", wave[:, ::2], wave[:, 1::2])
        known = basis.T @ wave
        squares -= np.einsum("nk,nk->k", known, known)
        crossed -= np.einsum("nk,nk->k", known[:, ::2], known[:, 1::2])
        along += values[start : start + part.size] @ wave
        start += part.size
    bb, aa = squares.reshape(count, 2).T
    bv, av = along.reshape(count, 2).T
    determinant = np.maximum(aa * bb - crossed**2, 1e-12 * aa * bb + 1e-300)
    explained = (bb * av**2 - 2 * crossed * av * bv + aa * bv**2) / determinant
    return nats_explained(values, explained, SCANNED_INDEPENDENT)


def _span(places: NDArray[np.intp]) -> slice | NDArray[np.intp]:
    """The same places without a copy where they follow each other."""
    first, last = int(places[0]), int(places[-1]) + 1
    return slice(first, last) if last - first == places.size else places


def _surroundings(grid: Grid, ring: Ring) -> FloatArray:
    """Sines and cosines of ring-downs at frequencies around the ring's, (m, 2 k)."""
    factors = [f for f in (0.55, 0.62, 0.7, 0.78, 1.28, 1.43, 1.6, 1.8) if ring.frequency_hz * f < 60.0]
    waves = ring_waves(grid, ring.frequency_hz * np.array(factors), np.full(len(factors), 0.03))
    return np.hstack([waves.imag, waves.real])


def _colour(waves: FloatArray, own: FloatArray, values: FloatArray) -> float:
    """Size of chance in waves around the ring's own (n, 2), over that of white noise; at least 1."""
    # The ring itself, if there is one, must not count as its own surroundings.
    left = values - own @ np.linalg.lstsq(own, values, rcond=None)[0]
    size = np.sqrt(np.maximum((waves**2).sum(0), 1e-300))
    z = (waves.T @ left) / size / max(float(np.std(left)), 1e-300)
    return max(1.0, robust_sd(z))


def ring_block(name: str, grid: Grid, signals: Sequence[Signal], ring: Ring, *, slow: bool) -> Block | None:
    """Coefficients of sine and cosine of every signal at the common oscillator; accelerations over ω²."""
    names: list[str] = []
    rows: list[FloatArray] = []
    shares: list[Shares] = []
    values, variances, fading, unequal = (list[float]() for _ in range(4))
    waves, beside = ring_columns(grid, ring.frequency_hz, ring.zeta), _surroundings(grid, ring)
    otherwise = [ring_columns(grid, ring.frequency_hz, f * ring.zeta) for f in _OTHER_DAMPING]
    natural = 2.0 * np.pi * ring.frequency_hz
    for signal in signals:
        bases = cleaner(grid, signal.pick, slow)
        both = _clean(np.column_stack([signal.values, waves]), bases)
        if len(both) < 60:
            continue
        places = np.concatenate([part for part, _ in bases])
        inverse: FloatArray = np.linalg.pinv(both[:, 1:]).astype(np.float64)
        coefficients = inverse @ both[:, 0]
        left = both[:, 0] - both[:, 1:] @ coefficients
        fraction = max(independent_fraction(left), OSCILLATION_INDEPENDENT)
        variance = float(left @ left) / max(left.size - 2, 1) / fraction * np.diag(inverse @ inverse.T)
        # What is left of the motion is no white noise: neighbouring frequencies say how large chance is.
        # And this frequency was chosen for its gain, which doubles it.
        variance *= 2.0 * _colour(_clean(beside, bases), _clean(waves, bases), both[:, 0]) ** 2
        scale = natural**2 if signal.family == "accelerometer" else 1.0
        full = np.zeros((2, grid.time_s.size))
        full[:, places] = inverse
        # Removing the bases is part of the projection.
        for part, basis in bases:
            full[:, part] -= (full[:, part] @ basis) @ basis.T
        names += [f"{word} in {signal.family}s" for word in ("sine", "cosine")]
        values += (coefficients / scale).tolist()
        variances += (variance / scale**2).tolist()
        rows += list(full / scale)
        shares += [signal.shares] * 2
        quick, slowly = (np.diag(inverse @ _clean(other, bases)) for other in otherwise)
        fading += ((quick - slowly) / (2.0 * np.log(_OTHER_DAMPING[0]))).tolist()
        unequal += [0.0, 0.0] if signal.unequal is None else (full / scale @ signal.unequal).tolist()
    if not names:
        return None
    units = ["s" if slow else "m s/rad"] * len(names) + ["Hz", "1"]
    names += ["frequency", "damping"]
    values += [ring.frequency_hz, ring.zeta]
    variances += [ring.frequency_sd**2, (ring.zeta_sd * ring.zeta) ** 2]
    rows += [np.zeros(grid.time_s.size)] * 2
    return Block(
        name,
        tuple(names),
        tuple(units),
        np.array(values),
        np.diag(variances),
        np.array(rows),
        np.ones(grid.time_s.size, dtype=bool),
        kind=name,
        ring=(ring.frequency_hz, ring.zeta, GRID_HZ),
        shares=tuple(shares),
        fading=tuple(fading),
        systematic={f"{name}_unequal": np.array([*unequal, 0.0, 0.0])},
        undone_s=next((s.undone_s for s in signals if s.family == "accelerometer"), 0.0),
    )


def with_repeatability(blocks: Sequence[Block]) -> list[Block]:
    """The blocks of all runs with what the ring-down itself repeats by, a share of its usual size.

    A share of the size in each run would make the small ones the sure ones. Frequency and damping come
    from all runs at once: what is said in every run is known only once.
    """
    parts = {
        name: np.array([b.values[b.names.index(name)] for b in blocks if name in b.names])
        for name in dict.fromkeys(n for b in blocks for n in b.names if " in " in n)
    }
    usual = {
        name.partition(" in ")[2]: float(np.median(np.hypot(values, parts["cosine" + name[4:]])))
        for name, values in parts.items()
        if name.startswith("sine")
    }
    widened = []
    for block in blocks:
        covariance = block.covariance.copy()
        for k, name in enumerate(block.names):
            if " in " in name:
                covariance[k, k] += (RING_SD * usual.get(name.partition(" in ")[2], 0.0)) ** 2
            else:
                covariance[k, k] *= len(blocks)
        widened.append(replace(block, covariance=covariance))
    return widened

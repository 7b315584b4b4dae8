"""A single wire that sticks: what it shows depends on the way that the wall moves, and no other wire's does.

A wire that stays where it is until it is pulled by some length lags behind the motion by that length,
whatever the speed. What it shows beside the mean of the other wires therefore has another sign where the
wall goes out than where it comes back. Gains, delays, zeros that move, ends that are not where the drawing
has them and noise leave functions of rotation, speed and time, which are fitted beside it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_LEAST_WIDTH_M: Final = 1.5e-4
"""Width of a loop that is named. Of sound wires it has a standard deviation of 0.02 mm and reaches 0.11 mm; a
wire that stays until it is pulled by 1 mm shows 0.3 to 0.7 mm, and moves r by up to 0.009. Raising it lets
that pass."""
_OTHERS_SIGMAS: Final = 6.0
"""The same in standard errors of the others' loops, median: in noisy laboratories sound loops are wider."""
_OWN_SIGMAS: Final = 3.5
"""The same in its own standard errors. A wire that jumps after what pulls it shows a loop that scatters:
raising it lets wires that jump by 1.5 mm pass."""
_OTHERS_SHARE: Final = 0.3
"""Share of the largest loop that the other wires may show once the wire that sticks is left out. Raising it
names one wire where a wall turns all of them."""
_FEWEST_WIRES: Final = 3
_ROUNDS: Final = 3
_SHAPE_M: Final = (2e-4, 2e-2)
"""Widths that the shape of a loop is drawn with: it hangs little on the width."""
_MANY_MEANS: Final = 9
"""Means by whose slope the way of the motion is told, against noise."""
_PIECE_MEANS: Final = 20
"""Length of a piece in means, 0.1 s: what sound wires leave is correlated over less."""


@dataclass(frozen=True, slots=True)
class Hysteresis:
    """Loop of one wire against the mean of the others."""

    width_m: float
    """Length of wire between both branches; positive where the wire lags."""
    sigma_m: float

    def is_wide(self, others: Sequence[Hysteresis]) -> bool:
        """Whether it is wider than those of sound wires are; `others`: of the other wires."""
        noise_m = float(np.median([other.sigma_m for other in others]))
        return self.width_m > max(_LEAST_WIDTH_M, _OTHERS_SIGMAS * noise_m, _OWN_SIGMAS * self.sigma_m)


def sticking_wire(means_rad: Floats, lever_m: Floats, noise_m: Floats) -> tuple[int, Hysteresis] | None:
    """The one wire that sticks, and its loop; None where none does or more than one seems to.

    `means_rad` (wires, n): each wire's own rotation, finite, in equal steps; `lever_m` (wires,) of shortening
    over rotation; `noise_m` (wires,) of one sample.
    """
    count = means_rad.shape[0]
    if count < _FEWEST_WIRES:
        return None
    weights = (lever_m / noise_m) ** 2
    loops = [_loop(means_rad, weights, lever_m, wire, range(count)) for wire in range(count)]
    worst = max(range(count), key=lambda wire: loops[wire].width_m / loops[wire].sigma_m)
    rest = [wire for wire in range(count) if wire != worst]
    if not loops[worst].is_wide([loops[wire] for wire in rest]):
        return None
    # In rotation, for the same sway of a wall is a longer loop the higher a wire is.
    limit = _OTHERS_SHARE * loops[worst].width_m / abs(lever_m[worst])
    for wire in rest:
        left = _loop(means_rad, weights, lever_m, wire, rest)
        if abs(left.width_m / lever_m[wire]) > limit and abs(left.width_m) > _OTHERS_SIGMAS * left.sigma_m:
            return None
    return worst, loops[worst]


def _loop(means_rad: Floats, weights: Floats, lever_m: Floats, wire: int, of: Sequence[int]) -> Hysteresis:
    """Loop of one of the wires `of` against the weighted mean of the others of them."""
    others = [other for other in of if other != wire]
    mean = weights[others] @ means_rad[others] / weights[others].sum()
    pulled = mean * lever_m[wire]
    smooth = np.column_stack(
        [
            pulled, np.abs(pulled), pulled**2, pulled * np.abs(pulled),
            np.gradient(pulled), np.linspace(-0.5, 0.5, pulled.size), np.ones(pulled.size),
        ]
    )  # fmt: skip
    basis, _ = np.linalg.qr(smooth / np.sqrt(np.mean(smooth**2, axis=0)))
    apart = (means_rad[wire] - mean) * lever_m[wire]
    apart -= basis @ (basis.T @ apart)
    ways = _ways(pulled)
    width, shape = _SHAPE_M[0], np.zeros(pulled.size)
    for _ in range(_ROUNDS):
        drawn = float(np.clip(width, *_SHAPE_M))
        shape = (followed(pulled, drawn, ways) - pulled) / drawn
        shape -= basis @ (basis.T @ shape)
        width = float(shape @ apart / (shape @ shape))
        if width < _SHAPE_M[0]:
            break
    pieces = pulled.size // _PIECE_MEANS
    left = ((apart - width * shape) * shape)[: pieces * _PIECE_MEANS].reshape(pieces, _PIECE_MEANS)
    sigma = math.sqrt(float(np.sum(left.sum(axis=1) ** 2))) / float(shape @ shape)
    return Hysteresis(width, max(sigma, 1e-9))


def _ways(pulled: Floats) -> list[tuple[slice, bool]]:
    """Parts of a motion (n,) in which it goes one way, and whether that is up."""
    slope = np.convolve(np.gradient(pulled), np.ones(_MANY_MEANS), mode="same")
    up = slope >= 0.0
    borders = [0, *(np.flatnonzero(up[1:] != up[:-1]) + 1).tolist(), pulled.size]
    return [(slice(start, stop), bool(up[start])) for start, stop in pairwise(borders)]


def followed(pulled: Floats, play: float, ways: Sequence[tuple[slice, bool]]) -> Floats:
    """What an end with `play` shows that is pulled through (n,): half of it behind, each way.

    It begins behind a pull away from zero.
    """
    reach = 0.5 * play
    shown, behind = np.empty_like(pulled), float(pulled[0] - math.copysign(reach, pulled[0]))
    for part, up in ways:
        if up:
            shown[part] = np.maximum(np.maximum.accumulate(pulled[part]) - reach, behind)
        else:
            shown[part] = np.minimum(np.minimum.accumulate(pulled[part]) + reach, behind)
        behind = float(shown[part.stop - 1])
    return shown

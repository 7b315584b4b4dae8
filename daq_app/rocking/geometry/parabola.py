"""The extremum of a sampled curve between its samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def vertex(values: NDArray[np.float64], at: int) -> tuple[int, float, float]:
    """(sample, shift from it in samples, second difference) of the parabola through a sample near `at`.

    `values`: (n,), three at least. The parabola goes through a sample and both its neighbours; the first and
    the last sample have theirs from the next. The shift is 0 where the three lie on a straight line.
    """
    inner = min(max(at, 1), values.size - 2)
    before, middle, after = values[inner - 1 : inner + 2].tolist()
    bend = before - 2.0 * middle + after
    return inner, 0.5 * (before - after) / bend if bend else 0.0, bend

"""Many runs with little around them: for fits that call the kernel thousands of times a second."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_hardware.dynamics import kernel
from sim_hardware.dynamics import parameters as par
from sim_hardware.dynamics import pieces as pc

_EMPTY = np.empty(0)


@dataclass(frozen=True, slots=True)
class BatchRun:
    """Views into a workspace, valid until its next run."""

    pieces: NDArray[np.float64]
    impacts: NDArray[np.float64]
    """(n, 5): time, θ̇⁻, θ̇⁺, side, kind (sim_hardware.dynamics.kernel)."""
    peaks: NDArray[np.float64]
    """(n, 2): time, θ."""
    ending: int
    """kernel.AT_REST, DURATION_OVER, OVERTURNED, or TABLE_FULL where the workspace was too small."""
    end_s: float


class Workspace:
    """Tables that are filled again and again. One per thread; the kernel releases the GIL."""

    def __init__(self, n_pieces: int = 4096, n_impacts: int = 2048) -> None:
        self._pieces = np.empty((n_pieces, pc.N_COLUMNS))
        self._impacts = np.empty((n_impacts, kernel.N_IMPACT_COLUMNS))
        self._peaks = np.empty((n_impacts, kernel.N_PEAK_COLUMNS))

    def run(self, vector: NDArray[np.float64], deviates: NDArray[np.float64] = _EMPTY) -> BatchRun:
        """One run of a parameter vector (sim_hardware.dynamics.parameters), unchecked."""
        used, hits, turns, ending, end_s = kernel.integrate(
            vector, deviates, self._pieces, self._impacts, self._peaks
        )
        return BatchRun(self._pieces[:used], self._impacts[:hits], self._peaks[:turns], ending, end_s)


def simulate_batch(
    vectors: NDArray[np.float64], times_s: NDArray[np.float64], deviates: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """(m, n) rotations, rad, of m parameter vectors (m, N_PARAMETERS) at n times since release.

    `deviates` (m, k) are the standard normal deviates of r by impact.  A run that needs more rows
    than a workspace has (thousands of impacts) is NaN after the last that fitted.
    """
    if vectors.ndim != 2 or vectors.shape[1] != par.N_PARAMETERS:
        raise ValueError(f"vectors must be (m, {par.N_PARAMETERS}), not {vectors.shape}")
    times = np.ascontiguousarray(times_s, dtype=np.float64)
    out = np.empty((len(vectors), times.size))
    workspace = Workspace()
    for i, vector in enumerate(vectors):
        run = workspace.run(vector, _EMPTY if deviates is None else np.ascontiguousarray(deviates[i]))
        pc.evaluate(run.pieces, times, out[i], _EMPTY, _EMPTY)
        if run.ending == kernel.TABLE_FULL:
            out[i, times > run.end_s] = np.nan
    return out

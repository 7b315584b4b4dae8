"""The goodness-of-fit gate: is what a hypothesis leaves over noise and scatter, or structure?

Every run's whitened residuals (innovations) are standard normal under the truth. Per channel and
observable the gate asks for their size (χ²), for structure that repeats over runs (a mean, a trend
with amplitude, with time and with side) and for what differs from run to run. A scatter size beyond
what repeatability allows is a failure too: a free scatter would otherwise swallow any misfit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from daq_app.gap.core.features import FloatArray, Run
from daq_app.gap.core.fit import Fit
from daq_app.gap.core.model import Scatter


@dataclass(frozen=True, slots=True)
class GroupTest:
    """Test of one group of features over all runs."""

    channel: str
    observable: str
    n: int
    mean_square: float
    p_size: float
    structure: float
    """Rms of the structured part, in noise units."""
    p_structure: float
    between_runs: float = 0.0
    """Rms of what the features of one run have in common and other runs do not, in noise units."""
    p_runs: float = 1.0


@dataclass(frozen=True, slots=True)
class Goodness:
    """Result of the gate."""

    passed: bool
    p_value: float
    """Smallest p of any test, times the number of tests."""
    worst: str
    """The failing (or nearest to failing) test in words."""
    worst_size: float
    """Largest significant misfit of any group, in noise units."""
    groups: tuple[GroupTest, ...]
    excessive_scatter: tuple[str, ...]


def check(
    fit: Fit,
    runs: Sequence[Run],
    scatters: Sequence[Scatter],
    p_gate: float = 1e-3,
    tolerated: float = 0.35,
) -> Goodness:
    """Apply the gate.

    `p_gate`: smallest p, after Bonferroni's correction, that passes. `tolerated`: structure below
    this size (noise units) passes whatever its p, since with thousands of features an
    irrelevant departure becomes significant.
    """
    groups = _gather(fit, runs)
    fraction = min(run.features.independent_fraction for run in runs)
    tests = [_test(key, z, basis, places, fraction) for key, (z, basis, places) in groups.items()]
    excessive = tuple(s.name for s in scatters if fit.sigmas[s.name] > s.high)
    count = 3 * max(len(tests), 1)
    p_min, worst, worst_size, passed = 1.0, "", 0.0, not excessive
    for test in tests:
        for p, size, words in (
            (test.p_size, abs(math.sqrt(test.mean_square) - 1.0), "is larger than noise and scatter"),
            (test.p_structure, test.structure, "follows amplitude, time or side"),
            (test.p_runs, test.between_runs, "differs from run to run"),
        ):
            corrected = min(p * count, 1.0)
            if corrected < p_min or not worst:
                p_min, worst = corrected, f"{test.observable} of {test.channel} {words}"
            if corrected < p_gate and size > tolerated:
                passed = False
                worst_size = max(worst_size, size)
    if excessive:
        worst = f"the {', '.join(excessive)} is larger than repeatability explains"
    return Goodness(passed, p_min, worst, worst_size, tuple(tests), excessive)


def _gather(
    fit: Fit, runs: Sequence[Run]
) -> dict[tuple[str, str], tuple[FloatArray, FloatArray, FloatArray]]:
    """(channel, observable) → innovations, their basis [1, amplitude, time, side], and their runs."""
    rows: dict[tuple[str, str], list[tuple[float, float, float, int]]] = {}
    for place, (run, innovations) in enumerate(zip(runs, fit.whitened, strict=True)):
        for label, z in zip(run.features.labels, innovations, strict=True):
            entry = (z, label.amplitude, label.order, place)
            rows.setdefault((label.channel, label.observable), []).append(entry)
    groups = {}
    for key, values in rows.items():
        array = np.asarray(values, dtype=float)
        amplitude, order = array[:, 1], array[:, 2]
        side = np.sign(amplitude)
        columns = [np.ones(len(array)), np.abs(amplitude), order, side, amplitude**2]
        kept = [columns[0]]
        for column in columns[1:]:
            trial = np.column_stack([*kept, column])
            if np.linalg.matrix_rank(trial, tol=1e-9 * max(np.abs(column).max(), 1e-30)) == trial.shape[1]:
                kept.append(column)
        basis, _ = np.linalg.qr(np.column_stack(kept))
        groups[key] = (array[:, 0], basis, array[:, 3])
    return groups


def _test(
    key: tuple[str, str], z: FloatArray, basis: FloatArray, places: FloatArray, fraction: float
) -> GroupTest:
    n = z.size
    between, p_runs = _between_runs(z - basis @ (basis.T @ z), places, fraction)
    effective = max(n * fraction, 1.0)
    total = float(z @ z)
    structured = float(np.sum((basis.T @ z) ** 2))
    k = basis.shape[1]
    return GroupTest(
        channel=key[0],
        observable=key[1],
        n=n,
        mean_square=total / n,
        p_size=float(chi2.sf(total / n * effective, effective)),
        structure=math.sqrt(max(structured - k / fraction, 0.0) / n),
        p_structure=float(chi2.sf(structured * fraction, k)),
        between_runs=between,
        p_runs=p_runs,
    )


def _between_runs(z: FloatArray, places: FloatArray, fraction: float) -> tuple[float, float]:
    """(size, p) of the means of runs with at least three features; a crack or a warm-up shows there."""
    sums = [(float(z[places == k].sum()), int(np.sum(places == k))) for k in np.unique(places)]
    kept = [(total, n) for total, n in sums if n >= 3]
    if len(kept) < 3:
        return 0.0, 1.0
    square = sum(total**2 / n for total, n in kept)
    count = sum(n for _, n in kept)
    size = math.sqrt(max(square - (len(kept) - 1) / fraction, 0.0) / count)
    return size, float(chi2.sf(square * fraction, len(kept) - 1))

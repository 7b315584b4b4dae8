"""What readings in steps do to the coefficients that are read from them.

Steps are no noise: the same ones come back in every half-cycle, and from the same zero in every run, so that
no regression sees what they do to it. So the rounding is done again, on the motion as it was, with the zero
anywhere within a step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.run_features import Examined
from daq_app.gap.rocking_model.motion.rotation import opening, straight_line, wall_rotation
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.sensors import CALIBRATION

DRAWS = 40
"""Zeros and calibrations that are tried."""
WITHIN = 6
"""Instants in each interval of the grid: a wire passes a step of some millimetres in one interval."""


def with_quantisation_errors(examined: Sequence[Examined], steps: Mapping[str, float]) -> list[RockingRun]:
    """The features of all runs with what steps, m, of whole families add to the errors of their blocks."""
    runs = [entry.features for entry in examined]
    for family in ("wire", "lvdt"):
        if family in steps:
            errors = [_rounded(entry, family, steps[family]) for entry in examined]
            runs = [_widened(run, more) for run, more in zip(runs, _known_once(errors), strict=True)]
    return runs


def _rounded(entry: Examined, family: str, step: float) -> dict[str, FloatArray]:
    """Coefficients, (DRAWS, k), that rounding alone makes in each block that a family's readings enter."""
    grid, run = entry.features.grid, entry.run
    chosen = _channels(entry, family)
    weights = _weights(run, family, chosen)
    blocks = [block for block in entry.features.blocks if block.family in weights]
    if not chosen or not blocks:
        return {}
    # Beyond the ends of the intervals the motion goes on straight.
    inside = (np.arange(WITHIN) + 0.5) / WITHIN - 0.5
    theta = grid.raw[:, None] + inside * np.gradient(grid.raw)[:, None]
    places = run.positions(chosen)
    if family == "wire":
        readings = places[:, 2, None, None] * theta
    else:
        readings = opening(theta, places[:, 0, None, None], run.survey.half_base_m)
    # One seed for all runs: a channel keeps its zero and its calibration from run to run.
    chance = np.random.default_rng(1)
    # All zeros alike: where they are not, less remains of the steps of sensors that move alike.
    zeros = chance.uniform(-0.5, 0.5, DRAWS)
    gains = 1.0 + CALIBRATION * chance.standard_normal((DRAWS, len(run.sensors)))[:, chosen]
    rows: dict[str, list[FloatArray]] = {block.family: [] for block in blocks}
    for zero, gain in zip(zeros, gains, strict=True):
        exact = gain[:, None, None] * readings / step
        # At rest the reading is a whole number of steps, whatever the zero.
        errors = step * (np.round(exact + zero) - exact).mean(axis=2)
        for block in blocks:
            rows[block.family].append(block.coefficients(weights[block.family] @ errors))
    return {name: np.array(found) for name, found in rows.items()}


def _channels(entry: Examined, family: str) -> list[int]:
    """Places of the channels that a family's rotation was made from."""
    run = entry.run
    if family == "wire":
        return wall_rotation(run)[1]
    return [i for i in run.indices("lvdt") if run.sensors[i].id in entry.joint.used]


def _weights(run: GapRun, family: str, chosen: Sequence[int]) -> dict[str, FloatArray]:
    """What each block makes of the readings of a family, sample by sample: a weight for each channel."""
    x, y, z = run.positions(chosen).T
    if family == "wire":
        return {"wire": z / (z @ z), "base": straight_line(z)[0]}
    lift, theta, twist = np.linalg.pinv(np.column_stack([np.ones_like(x), -x, -x * y]))
    return {"wire": -theta, "joint": lift, "twist": twist}


def _known_once(errors_by_run: Sequence[Mapping[str, FloatArray]]) -> list[dict[str, FloatArray]]:
    """Covariances, (k, k), of those coefficients in each run.

    What the same zero does alike in all runs is known only once, however many runs there are; the likelihood
    takes the errors of runs for independent, so each bears its share of what is not.
    """
    rows: list[dict[str, FloatArray]] = [{} for _ in errors_by_run]
    for name in dict.fromkeys(name for run in errors_by_run for name in run):
        having = [(row, run[name]) for row, run in zip(rows, errors_by_run, strict=True) if name in run]
        sds = [np.sqrt(np.mean(errors**2, axis=0)) + 1e-300 for _, errors in having]
        standardised = np.sum([errors / sd for (_, errors), sd in zip(having, sds, strict=True)], axis=0)
        share = np.sqrt(np.maximum(np.mean(standardised**2, axis=0) / len(having), 1.0))
        for row, errors in having:
            row[name] = np.outer(share, share) * (errors.T @ errors) / DRAWS
    return rows


def _widened(run: RockingRun, more: Mapping[str, FloatArray]) -> RockingRun:
    """The run with these covariances on top of those of its blocks."""
    wider = [replace(b, covariance=b.covariance + more.get(b.family, 0.0)) for b in run.blocks]
    return run.of_blocks(wider) if more else run

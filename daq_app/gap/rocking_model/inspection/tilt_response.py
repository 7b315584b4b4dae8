"""Does a tiltmeter show the rotation through a response of first order, or something else as well?

A pendulum, a fluid and a balanced mass do not tell gravity from the horizontal acceleration of where they are
mounted. That is no error of a gain or a time constant, and on a rocking wall it is as large as the rotation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.response import first_order
from daq_app.gap.rocking_model.features.run_features import Examined
from daq_app.gap.rocking_model.features.run_findings import RunFinding
from daq_app.gap.rocking_model.inspection.channel_faults import SCREENED
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ, coarse, gridded, mean_rotation
from daq_app.gap.rocking_model.records import GRAVITY_M_S2
from daq_app.gap.rocking_model.tolerances.inspection import FEELS_SD, FEELS_SHARE, TILT_UNLIKE, TILT_UNLIKE_SD
from daq_app.gap.rocking_model.tolerances.motion import AROUND_TEST_S

_TIME_CONSTANTS_S = np.geomspace(0.02, 2.0, 9)
"""Where the best one is looked for, s: a slower tiltmeter shows next to nothing of a rocking wall."""


@dataclass(frozen=True, slots=True)
class _Seen:
    """What one tiltmeter shows in one run that is no response of first order to the rotation."""

    left: float
    """Rms of it over that of all that the tiltmeter shows."""
    acceleration: float = 0.0
    """The share of the horizontal acceleration over g that fits it best …"""
    left_beside: float = np.inf
    """… and what remains beside that, as `left`."""


def unlike_rotation(examined: Sequence[Examined]) -> tuple[tuple[str, ...], list[list[RunFinding]]]:
    """Tiltmeters along x that show something else than the rotation, and the findings of each run."""
    sensors = examined[0].run.sensors
    places = [i for i in examined[0].run.indices("tiltmeter", "x") if all(e.run.reads(i) for e in examined)]
    some = examined[:: max(len(examined) // SCREENED, 1)][:SCREENED]
    odd = [i for i in places if float(np.median([_seen(entry, i).left for entry in some])) > TILT_UNLIKE]
    unlike = {sensors[i].id: [_seen(entry, i) for entry in examined] for i in odd}
    findings: list[list[RunFinding]] = [[] for _ in examined]
    for name, of_runs in unlike.items():
        explained = np.median([one.left_beside / one.left for one in of_runs]) < FEELS_SHARE
        for row, one in zip(findings, of_runs, strict=True):
            row.append(_finding(name, one, explained=bool(explained)))
    return tuple(unlike), findings


def _finding(name: str, seen: _Seen, *, explained: bool) -> RunFinding:
    if explained:
        words = "share of the horizontal acceleration"
        return RunFinding(f"acceleration@{name}", words, "1", abs(seen.acceleration), FEELS_SD)
    return RunFinding(f"unlike@{name}", "share of something else", "1", seen.left, TILT_UNLIKE_SD)


def _seen(entry: Examined, place: int) -> _Seen:
    """The same against the rotation that fits better: that of the joint, or that of the wires.

    A family that is slow or late makes all tiltmeters look odd.
    """
    grid = entry.features.grid
    measured = gridded(entry.run, place)
    still = measured[-round(AROUND_TEST_S * GRID_HZ) :]
    # White noise from sample to sample: what moves slowly belongs to what is looked for.
    noise = float(np.std(np.diff(still))) / np.sqrt(2.0)
    best = _against(grid.theta, measured, entry, place, noise)
    if best.left <= TILT_UNLIKE or (other := _other_rotation(entry)) is None:
        return best
    return min(best, _against(other, measured, entry, place, noise), key=lambda one: one.left)


def _other_rotation(entry: Examined) -> FloatArray | None:
    """The rotation on the grid that the motion is not read from; None where there is none."""
    run = entry.run
    if entry.features.reference == "wire":
        return coarse(entry.joint.theta, run.rate_hz)
    theta = mean_rotation(run)
    return None if theta is None else coarse(theta, run.rate_hz)


def _against(theta: FloatArray, measured: FloatArray, entry: Examined, place: int, noise: float) -> _Seen:
    grid = entry.features.grid
    pick = (grid.time_s < grid.rest_s + AROUND_TEST_S) & np.isfinite(measured)
    power = float(np.var(measured[pick])) + 1e-300
    left, _ = _best(theta, measured, grid, pick, 0.0)
    share = float(np.sqrt(max(left - noise**2, 0.0) / power))
    if share <= TILT_UNLIKE:
        return _Seen(share)
    beside, felt = _best(theta, measured, grid, pick, entry.run.sensors[place].position_m[2])
    return _Seen(share, felt, float(np.sqrt(max(beside - noise**2, 0.0) / power)))


def _best(
    theta: FloatArray, measured: FloatArray, grid: Grid, pick: NDArray[np.bool_], height_m: float
) -> tuple[float, float]:
    """(least mean square of what remains, share of the acceleration) over all time constants.

    `height_m`: of the tiltmeter, whose acceleration may be felt; 0 for one that feels none.
    """
    speed = np.gradient(theta, 1.0 / GRID_HZ)

    def fit(log_slow: float) -> tuple[float, float]:
        slow_s = float(np.exp(log_slow))
        shown = first_order(theta, slow_s)
        start = np.exp(-(grid.time_s - grid.time_s[0]) / slow_s)
        columns = [shown, np.ones_like(shown), grid.time_s, start]
        if height_m > 0.0:
            # τ ẏ + y = x twice: the response to an acceleration, impacts and all, needs no second derivative.
            columns.append(-height_m / GRAVITY_M_S2 * (speed - (theta - shown) / slow_s) / slow_s)
        design = np.column_stack(columns)[pick]
        sizes, *_ = np.linalg.lstsq(design, measured[pick], rcond=None)
        return float(np.mean((measured[pick] - design @ sizes) ** 2)), float(sizes[-1])

    tried = np.log(_TIME_CONSTANTS_S)
    k = int(np.argmin([fit(float(log_slow))[0] for log_slow in tried]))
    bounds = float(tried[max(k - 1, 0)]), float(tried[min(k + 1, tried.size - 1)])
    found = minimize_scalar(lambda x: fit(x)[0], bounds=bounds, method="bounded", options={"xatol": 5e-3})
    left, last = fit(float(found.x))
    return left, last if height_m > 0.0 else 0.0

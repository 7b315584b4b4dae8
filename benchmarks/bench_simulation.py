"""The simulator: a trajectory, the same by SciPy, and the synthesis of all 41 channels.

Times are of one core, the least of many repetitions (what the code costs when nothing else runs);
the accuracy beside them is against SciPy's DOP853 at a relative tolerance of 1e-12.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from benchmarks.support.effort import Effort
from benchmarks.support.figure import Figure
from daq_app.config import load_rig, plan_tasks
from daq_app.config.rig import Rig
from sim_hardware.direct import synthesise_test
from sim_hardware.dynamics import (
    Body,
    Motion,
    Release,
    Restitution,
    Workspace,
    motion_vector,
    simulate_motion,
)
from sim_hardware.dynamics import pieces as pc
from sim_hardware.virtual_rig import VirtualRig

RIG = Path(__file__).parents[1] / "configs" / "fr1.toml"
_BODY = Body(alpha_rad=0.215, p_rad_s=2.204, r0_m=1.525, mass_kg=5229.0, length_m=1.2)
_RELEASE = Release(0.35 * 0.215)
_RESTITUTION = Restitution(0.931)
"""An L3 release of FR1 that rocks for 10.3 s, with 57 impacts."""
_RUN_S = 10.0
TRAJECTORIES = 60
SCIPY_RUNS = 3
_RECORDS = 5
_TESTS = 4
_NONE = np.empty(0)


def least_s(action: Callable[[], object], repetitions: int, inner: int = 1) -> float:
    """Least time of one call over `repetitions` of `inner` calls."""
    action()
    best = math.inf
    for _ in range(repetitions):
        start = time.perf_counter()
        for _ in range(inner):
            action()
        best = min(best, (time.perf_counter() - start) / inner)
    return best


def trajectory_s(rate_hz: float, repetitions: int) -> float:
    """Seconds for one run from a parameter vector to θ at `rate_hz`."""
    workspace = Workspace()
    vector = motion_vector(_BODY, _RELEASE, _RESTITUTION)
    times = np.arange(round(_RUN_S * rate_hz)) / rate_hz
    theta = np.empty(times.size)

    def run() -> None:
        pc.evaluate(workspace.run(vector).pieces, times, theta, _NONE, _NONE)

    return least_s(run, repetitions, 10)


def scipy_run(rtol: float, rate_hz: float, n_impacts: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Impact times and θ at `rate_hz` by solve_ivp with events, half-cycle by half-cycle."""
    p2, alpha = _BODY.p_rad_s**2, _BODY.alpha_rad
    grid = np.arange(round(_RUN_S * rate_hz)) / rate_hz
    theta = np.zeros(grid.size)

    def slope(_: float, y: NDArray[np.float64]) -> list[float]:
        return [y[1], -p2 * math.sin(alpha - y[0])]

    def upright(_: float, y: NDArray[np.float64]) -> float:
        return float(y[0])

    upright.terminal = True  # type: ignore[attr-defined]
    upright.direction = -1  # type: ignore[attr-defined]
    t, y, side, impacts = 0.0, [_RELEASE.theta0_rad, 0.0], 1.0, []
    for _ in range(n_impacts):
        run = solve_ivp(
            slope,
            (t, t + 5.0),
            y,
            method="DOP853",
            rtol=rtol,
            atol=1e-3 * rtol,
            events=upright,
            dense_output=True,
        )
        end = float(run.t_events[0][0])
        inside = (grid >= t) & (grid < end)
        if inside.any():
            theta[inside] = side * run.sol(grid[inside])[0]
        impacts.append(end)
        t, y, side = end, [0.0, -_RESTITUTION.r * float(run.y_events[0][0][1])], -side
    return np.array(impacts), theta


def accuracy() -> tuple[float, float, Motion]:
    """(largest error of an impact time in s, largest relative change of energy between impacts)."""
    motion = simulate_motion(_BODY, _RELEASE, _RESTITUTION)
    times, _ = scipy_run(1e-12, 1.0, 25)
    late = float(np.abs(motion.impact_time_s[:25] - times).max())
    edges, drift = np.concatenate([[0.0], motion.impact_time_s]), 0.0
    for start, end in pairwise(edges):
        theta, omega, _ = motion.evaluate(np.linspace(start, end, 30)[:-1])
        lifted = np.cos(_BODY.alpha_rad - np.abs(theta)) - math.cos(_BODY.alpha_rad)
        energy = 0.5 * omega**2 + _BODY.p_rad_s**2 * lifted
        drift = max(drift, float(np.abs(energy / energy[0] - 1.0).max()))
    return late, drift, motion


def synthesis_times_real(rig: Rig, repetitions: int) -> float:
    """Seconds of 41 channels per second, all on one clock, over a whole test with noise."""
    wall = VirtualRig.from_rig(rig)
    terminals = tuple(channel.physical_channel for channel in rig.channels)
    blocks = [k * 0.5 + np.arange(2000) / 4000.0 for k in range(48)]

    def run() -> None:
        for block in blocks:
            wall.volts(terminals, block)

    return 24.0 / least_s(run, repetitions)


def direct_times_real(rig: Rig, repetitions: int) -> float:
    """Seconds of a whole test per second: motion, every channel's own skew, converters."""
    plan = plan_tasks(rig)
    test = synthesise_test(rig, plan)
    least = least_s(lambda: synthesise_test(rig, plan), repetitions)
    return test.readings.shape[1] / test.rate_hz / least


def figures(effort: Effort) -> list[Figure]:
    """Every figure of the simulator."""
    runs, scipy_runs = effort.of(TRAJECTORIES, 1), effort.of(SCIPY_RUNS, 1)
    records, tests = effort.of(_RECORDS, 1), effort.of(_TESTS, 1)
    slow, fast = trajectory_s(200.0, runs), trajectory_s(4000.0, runs)
    scipy_s = least_s(lambda: scipy_run(1e-9, 200.0, 55), scipy_runs)
    late, drift, motion = accuracy()
    rig = load_rig(RIG)
    lasts = f"{motion.end_s:.1f} s, {len(motion.impact_time_s)} impacts"
    return [
        Figure("10 s trajectory, θ at 200 Hz", slow * 1e3, "ms", runs, 0.1, note=f"least; motion of {lasts}"),
        Figure("10 s trajectory, θ at 4 kHz", fast * 1e3, "ms", runs, 0.5, note="least"),
        Figure("trajectories per second", 1.0 / slow, "1/s", runs, 1000.0, "high", "200 Hz, one core"),
        Figure(
            "solve_ivp with events, same run",
            scipy_s * 1e3,
            "ms",
            scipy_runs,
            note="DOP853, rtol 1e-9, 200 Hz",
        ),
        Figure("solve_ivp / this kernel", scipy_s / slow, "×", scipy_runs, note="same machine, same minute"),
        Figure("largest error of an impact time", late * 1e6, "µs", 1, 1.0, note="25 impacts, DOP853 1e-12"),
        Figure("energy lost between impacts", drift, "", 1, 1e-9, note="largest, relative"),
        Figure(
            "41 channels with noise",
            synthesis_times_real(rig, records),
            "× real",
            records,
            100.0,
            "high",
            "one core",
        ),
        Figure(
            "whole test, direct path",
            direct_times_real(rig, tests),
            "× real",
            tests,
            100.0,
            "high",
            "one core",
        ),
    ]

"""What sensor effects and the wall's deformations do to each family's coefficients and to the reference."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.signal import lfilter

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.run_features import RockingRun
from daq_app.gap.rocking_model.sensor_blocks import (
    GRID_HZ,
    Block,
    first_order,
    impacts_of,
    moment_shape,
    slip_shape,
)

REPEATABILITY: dict[tuple[str, str], float] = {
    ("wire", "zero"): 5e-5,
    ("wire", "gain"): 3e-4,
    ("wire", "lag"): 1e-4,
    ("wire", "even harmonic"): 2e-3,
    ("wire", "step with moment"): 2e-5,
    ("wire", "drift"): 3e-6,
    ("tiltmeter", "zero"): 1e-4,
    ("tiltmeter", "gain"): 1e-3,
    ("tiltmeter", "lag"): 2e-3,
    ("tiltmeter", "drift"): 1e-5,
    ("accelerometer", "zero"): 5e-3,
    ("accelerometer", "gain of gravity"): 3e-3,
    ("accelerometer", "gain of inertia"): 3e-3,
    ("accelerometer", "lag"): 2e-4,
    ("base", "zero"): 2e-4,
    ("base", "slip per speed"): 1e-4,
    ("base", "follows rotation"): 1e-3,
    ("base", "drift"): 1e-5,
    ("joint", "zero"): 2e-5,
    ("joint", "pivot"): 3e-4,
    ("joint", "pivot left against right"): 3e-4,
    ("joint", "pivot with rotation"): 3e-3,
    ("joint", "contact length"): 3e-5,
    ("joint", "drift"): 3e-6,
    ("twist", "zero"): 2e-5,
    ("twist", "follows rotation"): 3e-4,
    ("twist", "drift"): 3e-6,
}
"""Unit in which coefficients scatter from run to run; the model's scatter multiplies it."""


def true_rotations(run: RockingRun, values: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
    """(peaks, levels) of the wall behind those that the reference family shows."""
    peaks = run.swings.peak_rad
    side = np.sign(peaks)
    name = run.reference
    gain = np.full(peaks.shape, 1.0 + values.get(f"gain@{name}.error", 0.0))
    if name == "lvdt":
        # The face that opens is the one that measures: x < 0 for a positive rotation.
        gain = gain * (1.0 + np.where(side > 0, values["face_a"], values["face_b"]))
    else:
        gain = gain * (1.0 + values["cal_wire"])
    rest = run.swings.rest_s - run.swings.release_s
    drift = values.get("drift@wire.rate", 0.0) / run.wire_height_m if name == "wire" else 0.0
    offset = values["zero"] + drift * (run.swings.peak_s - rest)
    bend = values.get(f"wire_cosine@{name}.kappa", 0.0) * run.wire_height_m
    slow = _second_order(values, name)
    acceleration = -(values["p"] ** 2) * np.sin(values["alpha"] - np.abs(peaks)) * side
    lost = np.where(np.arange(peaks.size) > 0, slow * acceleration, 0.0)
    true = (peaks - offset - bend * peaks**2 - lost) / gain
    levels = side[:, None] * run.swings.levels
    behind = (levels - offset[:, None] - bend * levels**2) / gain[:, None]
    return true, np.abs(behind)


def _second_order(values: Mapping[str, float], name: str) -> float:
    """Second moment of a sensor's response less half the square of its delay, s²: what rounds a peak."""
    slow = values.get(f"slow_response@{name}.tau", 0.0)
    delay = values.get(f"filter_delay@{name}.tau", 0.0)
    return 0.5 * slow**2 + delay**2 / 6.0


def pause_at_impact(values: Mapping[str, float], speeds: FloatArray) -> FloatArray:
    """Time lost at each impact: contact, or the flight of a hop less what it saves on the way up."""
    pause = np.full(speeds.shape, values.get("dwell.tau", 0.0))
    flight = values.get("bounce.tau", 0.0)
    if flight:
        share = values.get("bounce.share", 0.5)
        pause = pause + flight * speeds / 0.2 * (1.0 - values["r"] ** (share - 1.0))
    return pause


def free_times(run: RockingRun, values: Mapping[str, float]) -> FloatArray:
    """Free forms of the probes: time features as piecewise linear functions of the peak."""
    total = np.zeros(len(run.timings))
    restoring, loss = "free_restoring.t0" in values, "free_dissipation.t0" in values
    if not (restoring or loss):
        return total
    count = run.swings.levels.shape[1]
    size = np.abs(run.swings.peak_rad) / values["alpha"]
    for i, timing in enumerate(run.timings):
        falls, across = timing.a < count and timing.b < count, timing.ka != timing.kb
        kind = (
            2
            if across or timing.a >= count > timing.b
            else min(timing.b if falls else timing.a - count, 2) - 1
        )
        shares = np.interp(size[timing.ka], (0.0, 0.15, 0.4), (0.0, 1.0, 2.0))
        low = int(min(shares, 1.0))
        if restoring:
            knots = [values[f"free_restoring.t{3 * kind + j}"] for j in (low, low + 1)]
            total[i] += knots[0] + (knots[1] - knots[0]) * (shares - low)
        if loss and kind < 2:
            knots = [values[f"free_dissipation.t{3 * kind + j}"] for j in (low, low + 1)]
            total[i] += (1.0 if falls else -1.0) * (knots[0] + (knots[1] - knots[0]) * (shares - low))
    return total


def block_coefficients(run: RockingRun, values: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
    """Predicted coefficients of all blocks of a run, and the unit of their scatter, each (k,)."""
    predicted, scatter = [], []
    for block in run.blocks:
        coefficients = _PREDICT[block.family](run, block, values)
        for i, name in enumerate(block.names):
            unit = REPEATABILITY[(block.family, name)]
            scatter.append(unit)
            coefficients[i] += 3 * unit * values.get(f"free_{block.family}.c{i}", 0.0)
        predicted.append(coefficients)
    if not predicted:
        return np.zeros(0), np.zeros(0)
    return np.concatenate(predicted), np.array(scatter)


def _family_difference(run: RockingRun, family: str, values: Mapping[str, float]) -> FloatArray | None:
    """What a family's sensor effects add to the rotation it shows, on the grid; None for nothing."""
    grid = run.grid
    total: FloatArray | None = None

    def add(series: FloatArray) -> None:
        nonlocal total
        total = series if total is None else total + series

    for name, parameter in (
        ("gain", "error"),
        ("lag", "tau"),
        ("slow_response", "tau"),
        ("filter_delay", "tau"),
        ("drift", "rate"),
        ("wire_cosine", "kappa"),
    ):
        value = values.get(f"{name}@{family}.{parameter}")
        if value is None:
            continue
        if name == "gain":
            add(value * grid.theta)
        elif name == "lag":
            add(np.interp(grid.time_s - value, grid.time_s, grid.theta) - grid.theta)
        elif name == "slow_response":
            add(first_order(grid.theta, value) - grid.theta)
        elif name == "filter_delay":
            add(_bessel(grid.theta, value) - grid.theta)
        elif name == "drift":
            scale = {"wire": run.wire_height_m, "lvdt": np.inf}.get(family, 1.0)
            add(value / scale * (grid.time_s - (run.swings.rest_s - run.swings.release_s)))
        else:
            add(run.wire_height_m * value * grid.theta**2)
    return total


def _bessel(values: FloatArray, delay_s: float) -> FloatArray:
    """Second-order Bessel low-pass of group delay `delay_s`, as two real steps of the coarse grid."""
    if delay_s <= 1e-5:
        return values
    omega, zeta = np.sqrt(3.0) / delay_s, np.sqrt(3.0) / 2.0
    step = 2.0 * GRID_HZ
    b0 = omega**2
    a = np.array(
        [step**2 + 2 * zeta * omega * step + b0, 2 * b0 - 2 * step**2, step**2 - 2 * zeta * omega * step + b0]
    )
    b = np.array([b0, 2 * b0, b0]) / a[0]
    a = a / a[0]
    shifted = values - values[0]
    found: FloatArray = lfilter(b, a, shifted) + values[0]
    return found


def _difference_of(run: RockingRun, first: str, second: str, values: Mapping[str, float]) -> FloatArray:
    a, b = _family_difference(run, first, values), _family_difference(run, second, values)
    total = np.zeros(run.grid.theta.size)
    if a is not None:
        total = total + a
    if b is not None:
        total = total - b
    return total


def _own_gain(run: RockingRun, values: Mapping[str, float]) -> float:
    """Calibration of the reference family on average of both sides."""
    return 0.5 * (values["face_a"] + values["face_b"]) if run.reference == "lvdt" else values["cal_wire"]


def _wire(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    theta = run.grid.theta
    series = _difference_of(run, "wire", "lvdt", values)
    faces = np.where(theta > 0, values["face_a"], values["face_b"])
    series = series + (values["cal_wire"] - faces) * theta + values["wire_even"] * theta**2
    if "compliance.phi" in values:
        series = series + values["compliance.phi"] * moment_shape(theta, values["alpha"])
    if "sliding.c" in values:
        series = series + values["sliding.c"] * _slip(run) / run.wire_height_m
    return block.coefficients(series)


def _slip(run: RockingRun) -> FloatArray:
    impact_s, speeds = impacts_of(run.grid)
    return slip_shape(run.grid.time_s, impact_s, speeds)


def _tiltmeter(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    theta = run.grid.theta
    series = (values["cal_tiltmeter"] - _own_gain(run, values)) * theta
    extra = _difference_of(run, "tiltmeter", run.reference, values)
    series = series + extra
    if "compliance.phi" in values:
        series = series + values["compliance.phi"] * moment_shape(theta, values["alpha"])
    slow = first_order(series, 0.3)
    coefficients = block.coefficients(slow)
    coefficients[block.names.index("lag")] += values["tilt_response"]
    return coefficients


def _accelerometer(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    own = values["cal_accelerometer"] + values.get("gain@accelerometer.error", 0.0)
    name = run.reference
    reference = _own_gain(run, values) + values.get(f"gain@{name}.error", 0.0)
    clock = 1.0 + values.get("clock.error", 0.0)
    late = values.get("lag@accelerometer.tau", 0.0) + values.get("filter_delay@accelerometer.tau", 0.0)
    late -= sum(values.get(f"{e}@{name}.tau", 0.0) for e in ("lag", "slow_response", "filter_delay"))
    found = {
        "gain of gravity": own - reference,
        "gain of inertia": (1.0 + own - reference) / clock**2 - 1.0,
        "lag": late,
    }
    return np.array([found.get(name, 0.0) for name in block.names])


def _joint(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """Opening at the middle of the base: u_z = (b/2 − a) sin|θ| and what the joint's effects make of it.

    The reference rotation carries the same calibration as the opening, so calibration cancels.
    """
    theta = run.grid.theta
    size, side = np.abs(theta), np.sign(theta)
    half, alpha = values["half_base"], values["alpha"]
    lift = (half - run.survey.half_base_m - values.get("pivot_shift.a", 0.0)) * size
    lift = (
        lift
        + side * values.get("alpha_asymmetry.delta", 0.0) * half / np.tan(alpha) / np.cos(alpha) ** 2 * size
    )
    lift = (
        lift
        - values.get("crushing.loss", 0.0) * 0.01 * run.impacts_before * alpha * half / np.tan(alpha) * size
    )
    lift = lift - 0.5 * values["mount_height"] * size**2
    if "winkler.theta_c" in values:
        theta_c = values["winkler.theta_c"]
        opened = half * (1.0 - 2.0 * np.sqrt(theta_c / np.maximum(size, theta_c))) * size + theta_c * half
        lift = lift + np.where(size > theta_c, opened - half * size, -half * size)
    if "rounded_edge.rho" in values:
        lift = lift - values["rounded_edge.rho"] * (size - 0.5 * size**2)
    lift = lift + values.get("drift@lvdt.rate", 0.0) * (
        run.grid.time_s - (run.swings.rest_s - run.swings.release_s)
    )
    return block.coefficients(lift)


def _base(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    series = values["base_follow"] * run.grid.theta + values.get("sliding.c", 0.0) * _slip(run)
    return block.coefficients(series)


def _twist(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    follow = values["twist_follow"] + values.get("twist.follow", 0.0)
    return block.coefficients(follow * run.grid.theta)


_PREDICT = {
    "wire": _wire,
    "tiltmeter": _tiltmeter,
    "accelerometer": _accelerometer,
    "joint": _joint,
    "base": _base,
    "twist": _twist,
}

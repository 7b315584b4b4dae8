"""The wall behind the reference rotation: what its family's faults hide of peaks, levels and impacts."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from daq_app.config.rig import G_M_S2
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.differences import face_gain
from daq_app.gap.rocking_model.features.pivots import turned_by
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.straightness import not_straight
from daq_app.gap.rocking_model.motion.rotation import anchors_turn
from daq_app.gap.rocking_model.prediction.wires_alone import peaks_carry
from sim_hardware.dynamics.parameters import SLIDE_SPEED


def true_rotations(run: RockingRun, values: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
    """(peaks, levels) of the wall behind those that the reference family shows."""
    peaks = run.swings.peak_rad
    side = np.sign(peaks)
    name = run.reference
    gain = np.full(peaks.shape, 1.0 + values.get(f"gain@{name}.error", 0.0))
    if name == "lvdt":
        # The face that opens is the one that measures: x < 0 for a positive rotation.
        gain = gain * (1.0 + np.where(side > 0, face_gain(values, "face_a"), face_gain(values, "face_b")))
    else:
        gain = gain * (1.0 + values["cal_wire"])
    drift = values.get("drift@wire.rate", 0.0) / run.wire_height_m if name == "wire" else 0.0
    offset = values["zero"] + drift * (run.swings.peak_s - run.grid.rest_s) + peaks_carry(run, values)
    levels = side[:, None] * run.swings.levels
    true, behind = peaks - offset, levels - offset[:, None]
    for added in (_bent, not_straight):
        true = true - added(run, values, peaks, "peaks")
        behind = behind - added(run, values, levels, "levels")
    if second := _second_order(values, name):
        # A delay moves peaks and crossings alike; what a response rounds beyond it goes with the
        # acceleration. At the first peak the wall is held.
        slow = second * values["p"] ** 2 * side
        true[1:] += slow[1:] * np.sin(values["alpha"] - np.abs(peaks[1:]))
        behind += slow[:, None] * np.sin(values["alpha"] - np.abs(levels))
    true /= gain
    true[0] += side[0] * values["theta0"]
    return true, np.abs(behind / gain[:, None])


def _bent(run: RockingRun, values: Mapping[str, float], theta: FloatArray, name: str) -> FloatArray | float:
    """What wires out of line, or on a wall with other pivots, add to the rotation that is read from them."""
    if run.reference != "wire":
        return 0.0
    added: FloatArray | float = turned_by(run, values, theta, name)
    if bend := values.get("wire_cosine@wire.kappa", 0.0):
        added = bend * run.wire_bend_m * theta**2
    if higher := values.get("wire_anchor@wire.height", 0.0):
        added = added + anchors_turn(run.wires, theta, higher)
    return added


def _second_order(values: Mapping[str, float], name: str) -> float:
    """Second moment of a sensor's response less half the square of its delay, s²: what rounds a peak.

    It is negative for a wire that swings, whose peaks are higher than the wall's.
    """
    slow = values.get(f"slow_response@{name}.tau", 0.0)
    delay = values.get(f"filter_delay@{name}.tau", 0.0)
    rounded = 0.5 * slow**2 + delay**2 / 6.0
    if frequency := values.get(f"wire_inertia@{name}.frequency", 0.0):
        zeta = values.get(f"wire_inertia@{name}.zeta", 0.2)
        rounded += (2.0 * zeta**2 - 1.0) / (2.0 * math.pi * frequency) ** 2
    return rounded


def pause_at_impact(values: Mapping[str, float], speeds: FloatArray, sides: FloatArray) -> FloatArray:
    """Time lost at each impact, (k,), s: contact, or the flight of a hop less what it saves on the way up.

    Of half-cycles that end with `speeds`, rad/s, on `sides`, ±1.
    """
    pause = values.get("dwell.tau", 0.0) + _behind_slips(values, speeds, sides)
    flight = values.get("bounce.tau", 0.0)
    if flight:
        share = values.get("bounce.share", 0.5)
        pause = pause + flight * speeds / 0.2 * (1.0 - values["r"] ** (share - 1.0))
    return pause


def _behind_slips(values: Mapping[str, float], speeds: FloatArray, sides: FloatArray) -> FloatArray:
    """Time by which the wall is behind a base that slips at impacts, (k,), s.

    In the frame of the base a slip s is a floor that moves by s: the rotation is −p²/g cos α · s behind
    (Housner 1963). A wall that goes on with r times its approach speed makes that good in a time that goes
    with s over this speed.
    """
    outwards = _slip_per_speed(values, "sliding", speeds)
    on = _slip_per_speed(values, "sliding_on", speeds) * (1.0 + values.get("sliding_on.own", 0.0))
    lever = values["p"] ** 2 / G_M_S2 * math.cos(values["alpha"]) / values["r"]
    # The wall comes down to the other side than that of the half-cycle.
    return np.asarray(lever * (outwards - sides * on))


def _slip_per_speed(values: Mapping[str, float], effect: str, speeds: FloatArray) -> FloatArray:
    """Slips that act back on the wall over their approach speeds, (k,), m s/rad."""
    strength = values.get(f"{effect}.back", 0.0) * values.get(f"{effect}.c", 0.0)
    square = values.get(f"{effect}.square", 0.0)
    return np.asarray(strength * (1.0 + square * (speeds / SLIDE_SPEED - 1.0)))

"""The base joint of a test in a few numbers: profile in the hold, pivots, contact, twist."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.analysis.preparation.signals import Signals
from daq_app.rocking.analysis.results import JointSummary, ValueWithSigma
from daq_app.rocking.geometry.joint import JointMotion
from daq_app.rocking.means import means_over
from daq_app.rocking.motion.swings import MotionTrack
from daq_app.rocking.record import TestRecord
from daq_app.rocking.theory.block import RigidBlock

Floats = NDArray[np.float64]

_CLEAR_RAD = 8e-3
"""The pivot is read where the rotation is larger than this."""
_ABOUT_S = 0.02
"""Reach of the median about a peak."""


def summarise_joint(record: TestRecord, signals: Signals, track: MotionTrack) -> JointSummary:
    """Summary over hold and motion. Needs `signals.joint`."""
    joint = signals.joint
    assert joint is not None
    release = int(np.searchsorted(signals.time_s, track.release.time_s))
    last = int(np.searchsorted(signals.time_s, track.impacts_s[-1]))
    hold = slice(max(release - round(record.rate_hz), 0), max(release - round(0.05 * record.rate_hz), 1))
    moving = slice(release, max(last, release + 1))
    ids = record.family("lvdt")
    positions = np.array([record.rig.channel(channel_id).position_m for channel_id in ids])
    specimen = record.rig.specimen
    theory = RigidBlock.from_specimen(specimen).semi_rigid(
        specimen.mortar_compressive_strength_pa, specimen.length_m
    )
    left, right = _pivot(joint, moving, -1), _pivot(joint, moving, 1)
    half = specimen.base_width_m / 2.0
    clear = np.abs(joint.rotation_rad[moving]) > _CLEAR_RAD
    return JointSummary(
        half_width_m=half,
        profile_ids=ids,
        profile_x_m=tuple(positions[:, 0].tolist()),
        profile_y_m=tuple(positions[:, 1].tolist()),
        profile_opening_m=tuple(_median(signals.openings_m[:, hold]).tolist()),
        profile_opposite_m=tuple(_median(signals.openings_m[:, _first_peak(signals, track)]).tolist()),
        pivot_left_m=left,
        pivot_right_m=right,
        inset_left_m=math.nan if left is None else half + left.value,
        inset_right_m=math.nan if right is None else half - right.value,
        inset_theory_m=theory.a_m,
        contact_m=float(_median(joint.contact_m[moving][clear][None])[0]),
        twist_hold_rad_per_m=float(_median(joint.twist_rad_per_m[hold][None])[0]),
        twist_peak_rad_per_m=_largest(joint.twist_rad_per_m[moving], record.rate_hz),
        gain_to_wires=math.nan if signals.fused is None else signals.fused.gain,
        suspects=joint.suspects,
        clipped=joint.clipped,
    )


def _first_peak(signals: Signals, track: MotionTrack) -> slice:
    """Samples about the first peak after impact 1; none where that half-cycle is not known."""
    arc = track.arcs[1] if len(track.arcs) > 1 else None
    if arc is None or not math.isfinite(arc.peak_s):
        return slice(0, 0)
    low, high = np.searchsorted(signals.time_s, [arc.peak_s - _ABOUT_S, arc.peak_s + _ABOUT_S])
    return slice(int(low), int(high))


def _median(rows: Floats) -> Floats:
    """Median along each row, NaN where a row has no finite value."""
    if rows.size and np.isfinite(rows).all():
        return np.asarray(np.median(rows, axis=1))
    result = np.full(rows.shape[0], np.nan)
    for index, row in enumerate(rows):
        good = row[np.isfinite(row)]
        if good.size:
            result[index] = np.median(good)
    return result


def _pivot(joint: JointMotion, moving: slice, side: int) -> ValueWithSigma | None:
    """Neutral axis while leaning to one side: median, and scatter (MAD)."""
    rotation, axis = joint.rotation_rad[moving], joint.neutral_axis_m[moving]
    some = axis[(side * rotation > _CLEAR_RAD) & np.isfinite(axis)]
    if some.size < 50:
        return None
    middle = float(np.median(some))
    return ValueWithSigma(middle, float(np.median(np.abs(some - middle))) * 1.4826)


def _largest(twist: Floats, rate_hz: float) -> float:
    """Largest |twist| of 10 ms means: noise alone does not count."""
    means = means_over(twist, max(1, round(0.01 * rate_hz)))
    means = means[np.isfinite(means)]
    return float(means[np.argmax(np.abs(means))]) if means.size else math.nan

"""The base joint of a test as files: its profile as CSV; profile, pivot, contact and twist as a picture."""

from __future__ import annotations

import csv
import io
import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from daq_app.rocking.analysis.results import JointSummary, TestAnalysis

Floats = NDArray[np.float64]

_LEFT, _RIGHT = "#1f5fa8", "#c2571a"
_MEAN_S = 0.005
"""Single samples of the profile are noisy: the picture shows means over this time."""


def profile_csv(joint: JointSummary) -> str:
    """One row per LVDT: place, opening in the hold and at the first peak on the other side."""
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(["lvdt", "x_m", "y_m", "opening_hold_m", "opening_first_opposite_peak_m"])
    rows = zip(
        joint.profile_ids,
        joint.profile_x_m,
        joint.profile_y_m,
        joint.profile_opening_m,
        joint.profile_opposite_m,
        strict=True,
    )
    writer.writerows(["" if isinstance(v, float) and math.isnan(v) else v for v in row] for row in rows)
    return out.getvalue()


def joint_figure(analysis: TestAnalysis) -> Any:
    """A figure: the opening profile, and pivot, contact length and twist against time."""
    from matplotlib.figure import Figure

    joint, series = analysis.joint, analysis.series
    assert joint is not None and series is not None
    figure = Figure(figsize=(10, 10), layout="constrained")
    profile, pivot, contact, twist = figure.subplots(4, 1)
    contact.sharex(pivot)
    twist.sharex(pivot)
    _draw_profile(profile, joint)
    start, end = analysis.release_s, analysis.half_cycles[-1].start_s
    low, high = np.searchsorted(series.time_s, [start - 0.5, end + 0.2])
    size = max(1, round(_MEAN_S * analysis.rate_hz))
    time, rotation, axis, length, twisted = (
        _means(values[low:high], size)
        for values in (
            series.time_s - start,
            series.rotation_rad,
            series.neutral_axis_m,
            series.contact_m,
            series.twist_rad_per_m,
        )
    )
    for side, colour, name in ((-1, _LEFT, "leaning to −x"), (1, _RIGHT, "leaning to +x")):
        there = np.where(rotation * side > 0, 1e3, np.nan)
        pivot.plot(time, there * axis, color=colour, lw=1.2, label=name)
        contact.plot(time, there * length, color=colour, lw=1.2)
    half = 1e3 * joint.half_width_m
    for edge in (-half, half):
        pivot.axhline(edge, color="0.5", ls="--", lw=0.8)
    pivot.set_ylim(-1.25 * half, 1.25 * half)
    pivot.set_ylabel("pivot x, mm")
    pivot.legend(loc="center right", frameon=False, fontsize=9)
    contact.set_ylabel("length in contact, mm")
    # The pivot is noise where the joint is nearly closed: the scale is that of most of the motion.
    _limit(contact, length * 1e3, 5.0)
    twist.plot(time, twisted * 1e3, color="#3a7d44", lw=1)
    twist.set_ylabel("twist, mrad/m")
    twist.set_xlabel("time from the release, s")
    for axes in (profile, pivot, contact, twist):
        axes.grid(alpha=0.3)
    figure.suptitle(f"{analysis.label}: base joint")
    return figure


def _means(values: Floats, size: int) -> Floats:
    """Means of consecutive samples; NaN where one of them is."""
    count = values.size // size
    return np.asarray(values[: count * size].reshape(count, size).mean(axis=1))


def _draw_profile(axes: Axes, joint: JointSummary) -> None:
    x, y = np.array(joint.profile_x_m), np.array(joint.profile_y_m)
    states = ((joint.profile_opening_m, "-", "hold"), (joint.profile_opposite_m, "--", "first opposite peak"))
    for openings, line, state in states:
        values = np.array(openings) * 1e3
        for face, colour, name in ((x < 0, _LEFT, "face at −x"), (x > 0, _RIGHT, "face at +x")):
            order = np.argsort(y[face])
            label = f"{name}, {state}"
            axes.plot(y[face][order], values[face][order], f"o{line}", ms=3, lw=1, color=colour, label=label)
    axes.set_xlabel("place along the wall y, m")
    axes.set_ylabel("opening, mm")
    axes.legend(frameon=False, fontsize=9, ncols=2)


def _limit(axes: Axes, values: Floats, least: float) -> None:
    finite = values[np.isfinite(values)]
    if finite.size:
        low, high = np.percentile(finite, [2.0, 98.0])
        margin = max(least, 0.5 * (high - low))
        axes.set_ylim(low - margin, high + margin)

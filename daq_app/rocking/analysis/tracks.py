"""Half-cycles of one test as each family shows them, and r by every method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.analysis.preparation.signals import Signals, TestTimes
from daq_app.rocking.estimators import DecaySeries, RestitutionEstimate, eav_series, estimate_all
from daq_app.rocking.motion.filtered_peaks import corrected_peaks
from daq_app.rocking.motion.swings import MotionSettings, MotionTrack
from daq_app.rocking.motion.velocity import VelocityFilter

Floats = NDArray[np.float64]

_COVERED = 0.9
"""A family that knows less of the record than this gives no r of its own."""


@dataclass(frozen=True)
class FamilyTracks:
    """The motion as the leading family, the other one, and both fused show it."""

    lead: MotionTrack
    other: MotionTrack | None
    other_name: str
    """``wires`` or ``lvdts``, as in the keys of `TestAnalysis.estimates`."""
    fused: MotionTrack | None

    def of(self, name: str) -> MotionTrack | None:
        """Track of ``wires`` or ``lvdts``."""
        return self.other if name == self.other_name else self.lead


def follow_families(signals: Signals, times: TestTimes, *, fuse: bool) -> FamilyTracks:
    """Tracks of the families that know most of the record; `fuse`: both together as well."""
    other_name = "wires" if signals.lead == "lvdts" else "lvdts"
    rotation = signals.wire_rotation_rad
    if other_name == "lvdts":
        rotation = np.full(rotation.size, np.nan) if signals.joint is None else signals.joint.rotation_rad
    fused = signals.fused.rotation_rad if fuse and signals.fused is not None else None
    return FamilyTracks(
        track_motion(signals.settings, times, signals.time_s, signals.rotation_rad),
        _track(signals, times, rotation),
        other_name,
        None if fused is None else _track(signals, times, fused),
    )


def _track(signals: Signals, times: TestTimes, rotation: Floats) -> MotionTrack | None:
    if np.isfinite(rotation).mean() <= _COVERED:
        return None
    return track_motion(signals.settings, times, signals.time_s, rotation)


def track_motion(
    settings: MotionSettings, times: TestTimes, time_s: Floats, rotation_rad: Floats
) -> MotionTrack:
    """Half-cycles of a whole record, one after the other as online."""
    assert times.release_s is not None
    first, last = np.searchsorted(time_s, [times.release_s - 1.0, times.impacts_s[0] + 1e-3])
    track = MotionTrack.begin(
        settings, time_s[first:last], rotation_rad[first:last], times.release_s, times.hold_rad
    )
    track.add_impacts(times.impacts_s, time_s, rotation_rad)
    return track


def decay_series(
    signals: Signals, tracks: FamilyTracks, peaks: Floats, velocity_filter: VelocityFilter
) -> dict[str, DecaySeries]:
    """What every method finds r from; the keys are those of `TestAnalysis.estimates`."""
    track = tracks.lead
    p, alpha = signals.settings.p_rad_s, signals.settings.alpha_rad
    noise = np.full(peaks.size, velocity_filter.noise_rad_s(signals.noise_rad))
    corrected = corrected_peaks(peaks, velocity_filter, p, alpha)
    series = {
        "eav": track.eav_series(),
        "crt": track.crt_series(),
        "crt_exact": track.crt_exact_series(),
        "eav_filtered": eav_series(peaks, noise, method="EAV, filtered peaks (biased low)"),
        "eav_filtered_corrected": eav_series(
            corrected, noise, method="EAV, filtered peaks, amplitude loss corrected"
        ),
    }
    for name, other in (("best", tracks.fused), (tracks.other_name, tracks.other)):
        if other is not None:
            series[f"eav_{name}"] = other.eav_series(f"EAV, rotation from {name}")
            series[f"crt_{name}"] = other.crt_series(f"CRT, rotation from {name}")
    return series


def estimates_of(series: dict[str, DecaySeries]) -> dict[str, RestitutionEstimate]:
    """r of each series, by the same keys."""
    return dict(zip(series, estimate_all(list(series.values())), strict=True))

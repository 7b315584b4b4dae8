"""Notes on the quality of a test: what a reader must know before believing its numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from daq_app.config.rig import Family
from daq_app.rocking.analysis.preparation.signals import Signals, TestTimes
from daq_app.rocking.analysis.release_rotation import NAMES, fit_levels
from daq_app.rocking.analysis.results import QualityNote, TestAnalysis
from daq_app.rocking.families.finding import FamilyFinding, families_left_out
from daq_app.rocking.motion.swings import MotionTrack
from daq_app.rocking.motion.transients import Onset
from daq_app.rocking.record import TestRecord

_THETA0_DISAGREEMENT = 0.005
_REST_TOLERANCE_RAD = 3e-4
_SEEN_ROTATION_RAD = 5e-3
"""Range of the LVDTs' rotation that tells the lever of a wire to a few percent."""
_FOLLOWED_SHARE = 0.02
"""Share of its variance that a wire may leave about a straight line in the LVDTs' rotation."""
_LEVER_TOLERANCE = 0.1
"""Difference of a wire's lever from that of its place that is told: three times what it is left out for."""
_SLIDING_TOLERANCE_M = 5e-4


def quality_notes(
    record: TestRecord,
    signals: Signals,
    times: TestTimes,
    track: MotionTrack | None,
    analysis: TestAnalysis | None,
    onsets: list[Onset | None],
    findings: Sequence[FamilyFinding],
) -> tuple[QualityNote, ...]:
    """All notes, warnings first."""
    notes = [QualityNote(finding.severity, finding.text) for finding in findings]
    notes += [*_part(record), *_sensors(record, signals), *_course(times), _alignment(record)]
    if track is not None and analysis is not None:
        notes += [*_agreement(signals, analysis), *_motion(track), *_shocks(record, onsets)]
    return tuple(sorted(notes, key=lambda note: note.severity != "warning"))


def _warn(text: str) -> QualityNote:
    return QualityNote("warning", text)


def _info(text: str) -> QualityNote:
    return QualityNote("info", text)


def _part(record: TestRecord) -> list[QualityNote]:
    if record.part_of is None:
        return []
    whole_s, start_s = record.part_of / record.rate_hz, record.first_sample / record.rate_hz
    end_s = start_s + record.n_samples / record.rate_hz
    return [_info(f"analysed from {start_s:.0f} s to {end_s:.0f} s of this recording of {whole_s:.0f} s")]


def _sensors(record: TestRecord, signals: Signals) -> list[QualityNote]:
    notes = []
    missing = [channel_id for channel_id in record.rig.channel_ids if channel_id not in record.channel_ids]
    if missing:
        notes.append(_warn(f"channels of the rig that the record does not have: {', '.join(missing)}"))
    notes += _zero(record, signals)
    for name, share in signals.excluded_share.items():
        notes.append(
            _warn(f"wire {name} disagreed with the others and was left out for {share:.1%} of the record")
        )
    notes += _places_of_wires(signals)
    bad = 1.0 - float(np.isfinite(signals.rotation_rad).mean())
    if bad > 0:
        notes.append(_warn(f"{bad:.2%} of the record has no rotation (gaps); half-cycles there are left out"))
    for name, values in zip(signals.geometry.wires.ids, signals.wires_m, strict=True):
        low, high = record.rig.channel(name).range_si
        edge, zero = 0.002 * (high - low), signals.zeros.get(name, 0.0)
        if np.any((values <= low + edge - zero) | (values >= high - edge - zero)):
            notes.append(_warn(f"wire {name} reached the end of its range"))
    if len(record.family("wire")) == 1:
        notes.append(_warn("the rotation is that of one wire: what is wrong with it shows in no other"))
    joint = signals.joint
    if joint is None:
        notes.append(_warn("too few LVDTs for a profile of the base joint"))
    else:
        if joint.suspects:
            notes.append(
                _warn(
                    f"LVDTs that do not fit the line of their face were left out: {', '.join(joint.suspects)}"
                )
            )
        if joint.clipped:
            notes.append(_info(f"LVDTs that reached the end of their range: {', '.join(joint.clipped)}"))
    return notes


def _places_of_wires(signals: Signals) -> list[QualityNote]:
    """Wires that follow the LVDTs' rotation by another lever than their place in the rig file gives.

    One wire may have any fault: only where several disagree, the rig is likely that of another set-up.
    """
    joint = signals.joint
    if joint is None or len(signals.excluded_share) < 2:
        return []
    known = np.isfinite(joint.rotation_rad) & np.isfinite(signals.wires_m).all(axis=0)
    rotation, shown = joint.rotation_rad[known], signals.wires_m[:, known]
    if np.count_nonzero(known) < 2 or float(np.ptp(rotation)) < _SEEN_ROTATION_RAD:
        return []
    apart = rotation - rotation.mean()
    levers = shown @ apart / float(apart @ apart)
    left = shown - shown.mean(axis=1, keepdims=True) - levers[:, None] * apart
    if np.any(left.var(axis=1) > _FOLLOWED_SHARE * shown.var(axis=1)):
        return []
    wires = signals.geometry.wires
    told = [
        f"{name} {lever:.2f} m (rig file {expected:.2f} m)"
        for name, lever, expected in zip(wires.ids, levers, wires.lever_m, strict=True)
        if abs(lever / expected - 1.0) > _LEVER_TOLERANCE
    ]
    if len(told) < 2:
        return []
    return [
        _warn(
            "wires follow the LVDTs' rotation as if they were at other heights than in the rig file: "
            f"{', '.join(told)}. Give the rig file of this set-up"
        )
    ]


def _zero(record: TestRecord, signals: Signals) -> list[QualityNote]:
    """Which zero the rotation is counted from, where it is not the tare before the test."""
    if signals.zero == "tare":
        return []
    reason = "the tare is not used" if record.tared else "no zero was taken before the test"
    if signals.zero == "rest":
        return [_info(f"{reason}: every sensor's zero is taken from the rest after it")]
    return [
        _warn(f"{reason}, and none is taken from a rest: rotation is counted from the certificates' offsets")
    ]


def _alignment(record: TestRecord) -> QualityNote:
    """By what the families are shifted onto one time base; the offsets are those of the run's task plan."""
    told = []
    families: tuple[tuple[Family, str], ...] = (
        ("wire", "wires"),
        ("lvdt", "LVDTs"),
        ("accelerometer", "accelerometers"),
        ("tiltmeter", "tiltmeters"),
    )
    for family, name in families:
        offsets = [record.offset_s(channel_id) * 1e3 for channel_id in record.family(family)]
        if offsets and max(map(abs, offsets)) > 0:
            told.append(f"{name} {min(offsets):+.3f} to {max(offsets):+.3f}")
    if not told:
        return _info("no known skews or delays: all channels are taken as sampled at the same instants")
    return _info("channels aligned by their known skews and delays, ms: " + ", ".join(told))


def _course(times: TestTimes) -> list[QualityNote]:
    notes = []
    kinds = [event.kind for event in times.events]
    if times.release_s is None:
        told = (
            "the wall was held, but no release follows"
            if "hold" in kinds
            else "no steady hold and no release"
        )
        return [_warn(f"this record shows no test: {told}")]
    if not times.impacts_s:
        return [_warn("a release but no impact: the wall was caught or the record ends too early")]
    if "caught" in kinds:
        notes.append(_warn("a first fall was caught; the last release is analysed"))
    if kinds.count("release") > 1 + kinds.count("caught"):
        notes.append(_warn("more than one release: the last is analysed"))
    if times.rest_s is None:
        notes.append(_warn("the record ends before the wall is at rest"))
    fallen = (event for event in times.events if event.kind == "rest" and "not upright" in event.text)
    notes.extend(_warn(event.text) for event in fallen)
    return notes


def _agreement(signals: Signals, analysis: TestAnalysis) -> list[QualityNote]:
    notes = []
    alpha = signals.settings.alpha_rad
    unfit = families_left_out(analysis.findings, held_as_well=True)
    values = {name: v.value for name, v in fit_levels(analysis.theta0_by_family, unfit).items()}
    if "tiltmeters" not in analysis.theta0_by_family:
        notes.append(_warn(f"no tiltmeter: θ0 is read from the {NAMES[signals.lead]}"))
    spread = max(values.values()) - min(values.values())
    if spread > _THETA0_DISAGREEMENT * alpha:
        told = ", ".join(f"{name} {value * 1e3:.2f}" for name, value in values.items())
        notes.append(_warn(f"the families disagree on θ0 by {spread / alpha:.1%} of α (mrad: {told})"))
    residuals = analysis.residuals
    if residuals is not None:
        left = residuals.rotation_wires_rad.value
        if abs(left) > _REST_TOLERANCE_RAD:
            notes.append(
                _warn(f"the wall came to rest at {left * 1e3:+.2f} mrad from the zero before the test")
            )
        slid = residuals.sliding_m
        if slid is not None and abs(slid.value) > max(_SLIDING_TOLERANCE_M, 4 * slid.sigma):
            notes.append(_warn(f"the base slid by {slid.value * 1e3:+.2f} mm"))
    return notes


def _motion(track: MotionTrack) -> list[QualityNote]:
    notes = []
    lost = [n + 1 for n, arc in enumerate(track.arcs) if arc is None]
    if lost:
        notes.append(_info(f"half-cycles before impacts {', '.join(map(str, lost))} could not be fitted"))
    return notes


def _shocks(record: TestRecord, onsets: list[Onset | None]) -> list[QualityNote]:
    if not record.family("accelerometer"):
        return [_info("no accelerometers: impact times are from the rotation alone")]
    heard = sum(onset is not None for onset in onsets)
    return [_info(f"accelerometers show {heard} of {len(onsets)} impacts")]

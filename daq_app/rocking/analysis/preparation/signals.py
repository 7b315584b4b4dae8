"""From a record to the signals that everything else works on, aligned in time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.analysis.preparation.fusion import Fused, fuse
from daq_app.rocking.analysis.results import Zero
from daq_app.rocking.geometry.joint import BaseJoint, JointMotion
from daq_app.rocking.geometry.kinematics import RotationGeometry
from daq_app.rocking.geometry.noise import white_noise
from daq_app.rocking.motion.phases import PhaseDetector, PhaseEvent, PhaseSettings
from daq_app.rocking.motion.swings import MotionSettings
from daq_app.rocking.record import TestRecord

Floats = NDArray[np.float64]

Lead = Literal["wires", "lvdts"]
"""The family whose rotation is analysed: the wires unless they are slow."""

TILT_SETTLING_S = 1.0
"""Tiltmeters are slow: their first second at rest still shows the rocking."""
_SHORTEST_REST_S = 0.3
"""A quiet end of the record of this length counts as rest after the fact."""


@dataclass(frozen=True)
class Signals:
    """Rotation, tilt and joint of a record; arrays (n,) or (channels, n)."""

    record: TestRecord
    geometry: RotationGeometry
    settings: MotionSettings
    phase_settings: PhaseSettings
    time_s: Floats
    """Instants that the rotation shows: the wires' known offsets included."""
    wires_m: Floats
    tilts_rad: Floats
    openings_m: Floats
    """Brought onto the wires' instants."""
    rotation_rad: Floats
    """Rotation of the family that leads; NaN in gaps."""
    wire_rotation_rad: Floats
    """From the wires; NaN in gaps."""
    lead: Lead
    bridged_rad: Floats
    """The same, gaps filled with the last value: for filters."""
    excluded_share: dict[str, float]
    """Share of the record in which each wire was left out."""
    noise_rad: float
    joint: JointMotion | None
    lvdt_noise_rad: float
    fused: Fused | None
    zeros: Mapping[str, float]
    """What was taken off each wire and LVDT as its zero, m: ranges hold for values with it."""
    zeroed_at_rest: bool = False
    """Whether the zeros were taken from the rest after the test."""

    @property
    def zero(self) -> Zero:
        """Where the zeros of these signals come from."""
        if self.zeroed_at_rest:
            return "rest"
        return "tare" if self.record.tared else "certificates"

    @property
    def first_s(self) -> float:
        """Sample 0 of the record, without offsets."""
        return self.record.first_sample / self.record.rate_hz

    def zeroed(self, rest: slice) -> Signals:
        """The same with every sensor's zero taken from the samples of a rest."""
        settled = slice(
            min(rest.start + round(TILT_SETTLING_S * self.record.rate_hz), rest.stop - 1), rest.stop
        )
        levels = [_levels(values, rest) for values in (self.wires_m, self.openings_m)]
        ids = (*self.record.family("wire"), *self.record.family("lvdt"))
        taken = zip(ids, np.concatenate(levels).tolist(), strict=True)
        zeroed = _combine(
            self.record,
            self.geometry,
            self.wires_m - levels[0][:, None],
            self.tilts_rad - _levels(self.tilts_rad, settled)[:, None],
            self.openings_m - levels[1][:, None],
            self.lead,
            {name: self.zeros.get(name, 0.0) + level for name, level in taken},
        )
        return replace(zeroed, zeroed_at_rest=True)


@dataclass(frozen=True)
class TestTimes:
    """What the phase detector found in a record."""

    __test__ = False  # not a test class, whatever its name begins with

    events: tuple[PhaseEvent, ...]
    release_s: float | None
    """Time of the last release that led to impacts, on the time base of the rotation."""
    hold_rad: float
    impacts_s: tuple[float, ...]
    rest_s: float | None
    rest: slice | None
    """Samples of the rest after the test, up to 2 s."""


def read_signals(record: TestRecord, lead: Lead = "wires") -> Signals:
    """Read and combine. `ValueError` where the record lacks the wires."""
    ids = record.family("wire")
    if not ids:
        raise ValueError("rotation is computed from wire potentiometers; the record has none")
    wires = set(ids)
    kept = tuple(c for c in record.rig.channels if c.family != "wire" or c.id in wires)
    rig = record.rig.model_copy(update={"channels": kept})
    frame = PhaseSettings.from_rig(rig, record.rate_hz, 0.0).frame_samples
    geometry = RotationGeometry.from_rig(rig, frame_samples=frame)
    empty = np.empty((0, record.n_samples))
    tilts, lvdts = record.family("tiltmeter", "x"), record.family("lvdt")
    base = geometry.time_offset_s(record.time_offsets_s)
    lags = [(record.offset_s(channel_id) - base) * record.rate_hz for channel_id in lvdts]
    return _combine(
        record,
        geometry,
        record.load(ids),
        record.load(tilts) if tilts else empty,
        _aligned(record.load(lvdts), lags) if lvdts else empty,
        lead,
        record.zeros_si,
    )


def _combine(
    record: TestRecord,
    geometry: RotationGeometry,
    wires_m: Floats,
    tilts_rad: Floats,
    openings_m: Floats,
    lead: Lead,
    zeros: Mapping[str, float],
) -> Signals:
    combined = geometry.rotation(wires_m)
    wire_rotation = combined.rotation_rad
    offset = geometry.time_offset_s(record.time_offsets_s)
    wire_noise = white_noise(wire_rotation)
    specimen = record.rig.specimen
    joint, lvdt_noise, fused = None, math.nan, None
    lvdts = record.family("lvdt")
    try:
        base = BaseJoint.from_rig(record.rig, lvdts)
    except ValueError:
        base = None  # too few LVDTs for a profile: said in the quality notes
    if base is not None:
        taken = np.array([[zeros.get(channel_id, 0.0)] for channel_id in lvdts])
        joint = replace(base, ranges_m=base.ranges_m - taken).motion(openings_m)
        lvdt_noise = white_noise(joint.rotation_rad)
        fused = fuse(wire_rotation, joint.rotation_rad, wire_noise, lvdt_noise)
    leads = lead == "lvdts" and joint is not None
    rotation = joint.rotation_rad if leads and joint is not None else wire_rotation
    # Readings with steps so wide that a held wall shows none: the noise that the rig file states is left.
    noise = (lvdt_noise if leads else wire_noise) or geometry.rotation_noise_rad()
    return Signals(
        record=record,
        geometry=geometry,
        settings=MotionSettings(record.rate_hz, specimen.p_rad_s, specimen.alpha0_rad),
        phase_settings=PhaseSettings.from_rig(record.rig, record.rate_hz, geometry.rotation_noise_rad()),
        time_s=record.time_s(offset),
        wires_m=wires_m,
        tilts_rad=tilts_rad,
        openings_m=openings_m,
        rotation_rad=rotation,
        wire_rotation_rad=wire_rotation,
        lead="lvdts" if leads else "wires",
        bridged_rad=_bridged(rotation),
        excluded_share={
            name: np.count_nonzero(excluded) / excluded.size
            for name, excluded in zip(geometry.wires.ids, combined.excluded, strict=True)
            if excluded.any()
        },
        noise_rad=noise,
        joint=joint,
        lvdt_noise_rad=lvdt_noise,
        fused=fused,
        zeros=zeros,
    )


def _bridged(rotation_rad: Floats) -> Floats:
    """The same (n,) with gaps filled with the last value before, a first one with the first after it."""
    bad = ~np.isfinite(rotation_rad)
    if not bad.any():
        return rotation_rad
    index = np.maximum.accumulate(np.where(bad, 0, np.arange(rotation_rad.size)))
    first = float(rotation_rad[~bad][0]) if not bad.all() else 0.0
    return np.where(bad[index], first, rotation_rad[index])


def find_phases(signals: Signals, *, ask_tiltmeters: bool = True) -> TestTimes:
    """Run the online detector over the whole record; `ask_tiltmeters`: whether they must confirm a hold."""
    record = signals.record
    detector = PhaseDetector(signals.phase_settings, record.first_sample)
    asked = signals.tilts_rad if ask_tiltmeters else signals.tilts_rad[:0]
    events = tuple(detector.process(signals.bridged_rad, asked))
    offset = float(signals.time_s[0]) - signals.first_s if signals.time_s.size else 0.0

    def seconds(sample: float) -> float:
        return sample / record.rate_hz + offset

    releases = [k for k, event in enumerate(events) if event.kind == "release"]
    followed = [k for k in releases if any(e.kind == "impact" for e in events[k:])]
    start = followed[-1] if followed else (releases[-1] if releases else len(events))
    impacts = tuple(seconds(event.sample) for event in events[start:] if event.kind == "impact")
    rests = [event.sample for event in events[start:] if event.kind == "rest"]
    end = None if rests else quiet_end(signals)
    first = math.ceil(rests[0]) - record.first_sample if rests else (None if end is None else end.start)
    rest = None
    if first is not None and impacts:
        stop = min(first + round(2.0 * record.rate_hz), record.n_samples)
        rest = slice(max(first, 0), stop) if stop - first >= _SHORTEST_REST_S * record.rate_hz else None
    return TestTimes(
        events=events,
        release_s=seconds(events[start].sample) if start < len(events) else None,
        hold_rad=detector.theta0_rad,
        impacts_s=impacts,
        rest_s=None if first is None or not impacts else seconds(first + record.first_sample),
        rest=rest,
    )


def quiet_end(signals: Signals) -> slice | None:
    """Quiet end of the record (samples), maybe shorter than the detector asks for; None without one."""
    size = signals.phase_settings.frame_samples
    frames = signals.bridged_rad[: signals.bridged_rad.size // size * size].reshape(-1, size).mean(axis=1)
    need = round(_SHORTEST_REST_S / signals.phase_settings.frame_s)
    if frames.size < need:
        return None
    level = float(frames[-need:].mean())
    loud = np.flatnonzero(np.abs(frames - level) > signals.phase_settings.quiet_rad / 2.0)
    first = int(loud[-1]) + 1 if loud.size else 0
    return slice(first * size, frames.size * size) if frames.size - first >= need else None


def _levels(values: Floats, rest: slice) -> Floats:
    """Median of each row (channels,) over a rest; 0 where it has none."""
    if not values.size:
        return np.zeros(values.shape[0])
    return np.asarray(np.nan_to_num(np.nanmedian(values[:, rest], axis=1)))


def _aligned(rows: Floats, lags: Sequence[float]) -> Floats:
    """Values (channels, n) at each instant, of channels sampled `lags` samples later; linear between samples.

    Skews within a family matter as much as those between families: LVDTs along the wall that are read one
    after the other would show a rocking wall twisting.
    """
    aligned, earlier = np.empty_like(rows), np.empty(rows.shape[1])
    last = rows.shape[1] - 1
    for row, lag in enumerate(lags):
        whole = math.floor(lag)
        share = lag - whole
        _shift(rows[row], min(max(whole, -last), last), aligned[row])
        if share:
            _shift(rows[row], min(max(whole + 1, -last), last), earlier)
            earlier -= aligned[row]
            earlier *= share
            aligned[row] += earlier
    return aligned


def _shift(values: Floats, by: int, out: Floats) -> None:
    """`values` moved `by` samples to later into `out`; the ends are continued as constant."""
    if by > 0:
        out[by:], out[:by] = values[:-by], values[0]
    elif by < 0:
        out[:by], out[by:] = values[-by:], values[-1]
    else:
        out[:] = values

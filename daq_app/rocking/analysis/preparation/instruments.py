"""Before the numbers: hum, signs and units, late, slow and deviating instruments are found and put right.

Three looks, each on what the last left: mains hum in every channel; signs and units of whole families, on the
still parts; and, once the test is found, how families and single wires follow each other through the motion.
What was found is said, with what was done about it. The recording itself is not changed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.analysis.preparation.gains import FamilyGains, gains_of
from daq_app.rocking.analysis.preparation.odd_wire import compared_wires, odd_wire, wire_means
from daq_app.rocking.analysis.preparation.signals import (
    Lead,
    Signals,
    TestTimes,
    find_phases,
    quiet_end,
    read_signals,
)
from daq_app.rocking.families import words
from daq_app.rocking.families.finding import FamilyFinding
from daq_app.rocking.families.hum import find_hum
from daq_app.rocking.families.noise import slow_noise
from daq_app.rocking.families.response import DRIFT_RAD, LATE_S, SLOW_S, Response, compare
from daq_app.rocking.families.scales import wrong_scales
from daq_app.rocking.families.shocks import LATE_SHOCKS_S, ShockTiming, shock_timing
from daq_app.rocking.families.treated import Corrections, held_in_memory, without_hum
from daq_app.rocking.geometry.joint import BaseJoint
from daq_app.rocking.geometry.kinematics import RotationGeometry
from daq_app.rocking.means import block_means, median_of_few
from daq_app.rocking.motion.bending import Bending, find_bending
from daq_app.rocking.motion.swings import REST_ZERO_SIGMA_RAD
from daq_app.rocking.record import TestRecord

Floats = NDArray[np.float64]

GAIN_SHARE = 0.01
"""Gain of one family against the other that is named: three times what calibration leaves."""
_COVERED = 0.98
"""LVDTs take the wires' place where they know at least this share of the motion."""
_COMPARED_IMPACTS = 12
_NOTABLE_HUM_NOISES = 1.5
"""Hum above this many times a channel's noise is a warning; below it is taken out and remarked. Ordinary
laboratories with noise twice the rig file's reach 1."""
_CRUDE_MEAN_S = 0.005
"""Signs and units are found from means of this length: whatever they hide is no factor of 10."""
_HOLD_S = 1.0
"""Slow noise is looked for in this last part of the hold."""


@dataclass(frozen=True)
class Instruments:
    """Signals with the instruments put right, the test found in them, and what was found on the way."""

    record: TestRecord
    signals: Signals
    times: TestTimes
    findings: tuple[FamilyFinding, ...]
    response: Response | None
    """How the wires follow the LVDTs after all corrections."""
    shocks: ShockTiming | None
    gains: FamilyGains
    bending: Bending | None = None
    """How the wall bends, where it does: its wires and tiltmeters are then off by it."""

    @property
    def bent_at_rest_rad(self) -> float:
        """Standard uncertainty by bending of a zero that wires and tiltmeters took from the rest."""
        return self.bending.last_rad if self.bending is not None and self.signals.zeroed_at_rest else 0.0

    @property
    def gain_sigma(self) -> float:
        """Standard uncertainty of the gain of the rotation that is analysed, as a share."""
        return self.gains.of(self.signals.lead)


def prepare(record: TestRecord, *, from_rest: bool) -> Instruments:
    """Read, clean, find the test, put instruments right. `ValueError` where the record lacks the wires."""
    families = [record.family("wire"), record.family("lvdt"), record.family("tiltmeter", "x")]
    held, findings = _without_hum(held_in_memory(record, families), [ids for ids in families if ids])
    scaled, corrections = _put_to_scale(held)
    findings += scaled
    corrected = corrections.applied(held)
    signals, times = _zeroed_at_rest(corrected) if from_rest else _as_recorded(corrected)
    if times.release_s is None or not times.impacts_s:
        return Instruments(corrected, signals, times, tuple(findings), None, None, FamilyGains())
    return _in_step(corrected, signals, times, findings, from_rest=from_rest)


def _as_recorded(
    record: TestRecord, lead: Lead = "wires", *, ask_tiltmeters: bool = True
) -> tuple[Signals, TestTimes]:
    signals = read_signals(record, lead)
    return signals, find_phases(signals, ask_tiltmeters=ask_tiltmeters)


def _zeroed_at_rest(
    record: TestRecord, lead: Lead = "wires", *, ask_tiltmeters: bool = True
) -> tuple[Signals, TestTimes]:
    """With every sensor's zero from the rest after the test; as recorded where no rest shows a test.

    Offsets of a run without a tare may be so large that no hold is recognised, so the end of the record
    serves as the first guess of the rest.
    """
    signals = read_signals(record, lead)
    end = quiet_end(signals)
    guess = signals if end is None else signals.zeroed(end)
    times = find_phases(guess, ask_tiltmeters=ask_tiltmeters)
    if times.rest is None:
        times = find_phases(signals, ask_tiltmeters=ask_tiltmeters)
    if times.rest is None:
        return signals, times
    signals = signals.zeroed(times.rest)
    return signals, find_phases(signals, ask_tiltmeters=ask_tiltmeters)


# -- before the test is found ----------------------------------------------------------------------


def _without_hum(
    record: TestRecord, families: Sequence[tuple[str, ...]]
) -> tuple[TestRecord, list[FamilyFinding]]:
    ids = tuple(channel_id for family in families for channel_id in family)
    noises = [record.rig.channel(channel_id).noise_si for channel_id in ids]
    hum = find_hum([record.load(family) for family in families], noises, record.rate_hz)
    if hum is None:
        return record, []
    findings = []
    for family, name in words.FAMILY_NAMES.items():
        rows = [k for k, channel_id in enumerate(ids) if record.rig.channel(channel_id).family == family]
        rows = [k for k in rows if hum.amplitude[k]]
        if rows:
            notable = any(abs(hum.amplitude[k]) > _NOTABLE_HUM_NOISES * noises[k] for k in rows)
            unit = record.rig.channel(ids[rows[0]]).si_unit
            largest = float(np.abs(hum.amplitude[rows]).max())
            channels = tuple(ids[k] for k in rows)
            findings.append(words.hum(name, channels, largest, unit, hum.frequency_hz, notable=notable))
    if findings and hum.wrong_rate_share:
        findings[0] = words.with_wrong_rate(findings[0], hum.wrong_rate_share)
    return without_hum(record, ids, hum), findings


def _put_to_scale(record: TestRecord) -> tuple[list[FamilyFinding], Corrections]:
    """Signs and units of whole families, from rotations that need no hold to be found."""
    findings, factors = [], {}
    size = max(1, round(_CRUDE_MEAN_S * record.rate_hz))
    wrong = wrong_scales(_crude_rotations(record, size), record.rate_hz / size)
    for name, factor in wrong.items():
        family = words.families_by_name()[name]
        axis = "x" if family == "tiltmeter" else None
        findings.append(words.scale(name, factor))
        factors.update(dict.fromkeys(record.family(family, axis), 1.0 / factor))
    return findings, Corrections(factors=factors)


def _crude_rotations(record: TestRecord, size: int) -> dict[str, Floats]:
    """Rotation by family from means of `size` samples, linear, so that a wrong unit stays a factor."""

    def means(channel_ids: tuple[str, ...]) -> Floats:
        return block_means(record.load(channel_ids), size)

    rotations: dict[str, Floats] = {}
    ids = record.family("wire")
    if len(ids) >= 2:
        geometry = RotationGeometry.from_rig(record.rig)
        levers = {
            wire: float(lever) for wire, lever in zip(geometry.wires.ids, geometry.wires.lever_m, strict=True)
        }
        of_each_wire = means(ids) / np.array([[levers[channel_id]] for channel_id in ids])
        levels = np.nanmedian(of_each_wire, axis=1, keepdims=True)
        rotations["wires"] = median_of_few(of_each_wire - levels)
    lvdts = record.family("lvdt")
    try:
        joint = BaseJoint.from_rig(record.rig, lvdts)
    except ValueError:
        joint = None
    if joint is not None:
        openings = means(lvdts)
        left = joint.x_m < 0
        across = float(joint.x_m[~left].mean() - joint.x_m[left].mean())
        rotations["LVDTs"] = (median_of_few(openings[left]) - median_of_few(openings[~left])) / across
    tilts = record.family("tiltmeter", "x")
    if tilts:
        rotations["tiltmeters"] = means(tilts).mean(axis=0)
    return rotations


# -- once the test is found ------------------------------------------------------------------------


def _in_step(
    record: TestRecord,
    signals: Signals,
    times: TestTimes,
    findings: list[FamilyFinding],
    *,
    from_rest: bool,
) -> Instruments:
    """Single wires and the timing of families; read again where something had to be put right."""
    read = _zeroed_at_rest if from_rest else _as_recorded
    lead: Lead = "wires"
    means = wire_means(signals, _motion(signals, times))
    wires = compared_wires(signals, means)
    changed = Corrections()
    bending = _bending(signals, times, None)
    odd = odd_wire(signals, means, wires, bends=bending is not None)
    if odd is not None:
        findings.append(odd)
        changed = replace(changed, left_out=frozenset(odd.channels))
    response = _follow(signals, times)
    shocks = _shocks(record, signals, times)
    if bending is not None:
        # Delays and first orders are no answer to what the wall does between the two families.
        lead = "lvdts" if _lvdts_cover(signals, times) else "wires"
        findings.append(words.bending(bending.frequency_hz, bending.rms_rad, left_out=lead == "lvdts"))
    elif response is not None:
        timing, lead, earlier = _timing(record, signals, times, response, shocks)
        findings += timing
        changed = replace(changed, earlier_s=earlier)
        # A family that is slow or late, even by less than is named, may leave more between the two than
        # the ringing of a wall that bends.
        bending = _bending(signals, times, response)
        if bending is not None:
            blamed = any("LVDTs" in finding.family for finding in timing)
            lead = "wires" if blamed or not _lvdts_cover(signals, times) else "lvdts"
            findings.append(words.bending(bending.frequency_hz, bending.rms_rad, left_out=lead == "lvdts"))
    if changed.left_out or changed.earlier_s or lead != "wires":
        corrected = changed.applied(record)
        # Tiltmeters on a wall that bends took a zero that may be off, and confirm no hold by it.
        again, times_again = read(corrected, lead, ask_tiltmeters=bending is None)
        if times_again.impacts_s:
            record, signals, times = corrected, again, times_again
            wires = compared_wires(signals, wire_means(signals, _motion(signals, times)))
            response = _follow(signals, times)
            shocks = _shocks(record, signals, times)
        else:
            findings = [
                words.not_done(finding) if _needs_reading(finding) else finding for finding in findings
            ]
    if response is not None and bending is None:
        findings += _levels(signals, times, response)
    return Instruments(
        record, _with_errors(signals, times), times, tuple(findings), response, shocks,
        gains_of(signals, times, wires), bending,
    )  # fmt: skip


def _needs_reading(finding: FamilyFinding) -> bool:
    """Whether the test is read again for what is done about it: LVDTs are left out by not being asked."""
    if finding.treatment == "left out":
        return finding.family == "wires"
    return finding.treatment == "put in step"


def _motion(signals: Signals, times: TestTimes) -> slice:
    """Samples from just before the release to the last impact that tells something of timing."""
    assert times.release_s is not None
    last = times.impacts_s[min(len(times.impacts_s), _COMPARED_IMPACTS) - 1]
    start, stop = np.searchsorted(signals.time_s, [times.release_s - 0.3, last + 0.2])
    return slice(int(start), int(stop))


def _follow(signals: Signals, times: TestTimes) -> Response | None:
    """How the wires follow the LVDTs through the motion."""
    if signals.joint is None:
        return None
    part = _motion(signals, times)
    return compare(signals.time_s[part], signals.joint.rotation_rad[part], signals.wire_rotation_rad[part])


def _bending(signals: Signals, times: TestTimes, response: Response | None) -> Bending | None:
    """How the wires ring about the LVDTs through the motion, once both are as late and as slow as either."""
    if signals.joint is None:
        return None
    part = _motion(signals, times)
    lvdts, wires = signals.joint.rotation_rad[part], signals.wire_rotation_rad[part]
    if response is not None:
        lvdts, wires = response.made_alike(signals.record.rate_hz, lvdts, wires)
    return find_bending(signals.time_s[part], wires, lvdts, times.impacts_s)


def _lvdts_cover(signals: Signals, times: TestTimes) -> bool:
    """Whether the LVDTs know enough of the motion to take the wires' place."""
    assert signals.joint is not None
    known = np.isfinite(signals.joint.rotation_rad[_motion(signals, times)]).mean()
    return bool(known >= _COVERED)


def _shocks(record: TestRecord, signals: Signals, times: TestTimes) -> ShockTiming | None:
    ids = record.family("accelerometer")

    def read(start: int, stop: int) -> Floats:
        return record.load(ids, start, stop)

    offsets = [record.offset_s(channel_id) for channel_id in ids]
    return shock_timing(read, record.n_samples, record.rate_hz, signals.first_s, offsets, times.impacts_s)


def _timing(
    record: TestRecord, signals: Signals, times: TestTimes, response: Response, shocks: ShockTiming | None
) -> tuple[list[FamilyFinding], Lead, dict[str, float]]:
    """Slow and late families: findings, the family that leads, and by how much channels are moved earlier."""
    if response.response_s > SLOW_S:
        lead: Lead = "lvdts" if _lvdts_cover(signals, times) else "wires"
        return [words.slow("wires", response.response_s, left_out=lead == "lvdts")], lead, {}
    if response.response_s < -SLOW_S:
        return [words.slow("LVDTs", -response.response_s, left_out=True)], "wires", {}
    late = response.delay_s
    lag = None if shocks is None else shocks.lag_s
    if abs(late) <= LATE_S:
        if lag is not None and abs(lag) > LATE_SHOCKS_S:
            return [words.late("accelerometers", lag, "wires and LVDTs")], "wires", {}
        return [], "wires", {}
    if lag is None:
        later = "wires" if late > 0 else "LVDTs"
        return [words.one_of_two_late(later, abs(late))], "wires", {}
    # Shocks come `lag` after the wires' crossings and `lag + late` after the LVDTs'.
    if abs(lag) > abs(lag + late):
        moved = dict.fromkeys(record.family("wire"), late)
        return [words.late("wires", late, "LVDTs and accelerometers")], "wires", moved
    moved = dict.fromkeys(record.family("lvdt"), -late)
    return [words.late("LVDTs", -late, "wires and accelerometers")], "wires", moved


def _levels(signals: Signals, times: TestTimes, response: Response) -> list[FamilyFinding]:
    """Gain and drift of wires against LVDTs, blamed on the one that the tiltmeters contradict."""
    assert times.release_s is not None and signals.joint is not None
    drift = response.drift_rad_s * response.span_s
    apart = response.gain - 1.0
    if abs(drift) <= DRIFT_RAD and abs(apart) <= GAIN_SHARE:
        return []
    start, stop = np.searchsorted(signals.time_s, [times.release_s - 0.5, times.release_s - 0.02])
    hold = slice(int(start), int(stop))
    wires, lvdts = (
        float(np.nanmedian(values[hold])) if np.isfinite(values[hold]).any() else math.nan
        for values in (signals.wire_rotation_rad, signals.joint.rotation_rad)
    )
    tilt = math.nan
    if signals.tilts_rad.shape[0]:
        tilt = signals.geometry.tilt(signals.tilts_rad[:, hold], wires)
    family = "wires or LVDTs"
    if math.isfinite(tilt) and math.isfinite(wires) and math.isfinite(lvdts):
        by_wires, by_lvdts = abs(wires - tilt), abs(lvdts - tilt)
        if max(by_wires, by_lvdts) > 2.0 * min(by_wires, by_lvdts):
            family = "wires" if by_wires > by_lvdts else "LVDTs"
    if abs(drift) > DRIFT_RAD:
        return [words.drift(family, drift)]
    return [words.gain(family, apart)]


def _with_errors(signals: Signals, times: TestTimes) -> Signals:
    """The same with half-cycles judged by what the zero and long means may be wrong by.

    The stiller of hold and rest counts: a held wall may sway on its rope, and a rest may begin with the last
    impacts.
    """
    assert times.release_s is not None
    rate = signals.record.rate_hz
    start, stop = np.searchsorted(signals.time_s, [times.release_s - _HOLD_S, times.release_s - 0.02])
    still = [signals.rotation_rad[start:stop]]
    if times.rest is not None:
        still.append(signals.rotation_rad[times.rest])
    slow_noises = [slow for slow in (slow_noise(part, rate) for part in still) if math.isfinite(slow)]
    settings = signals.settings
    if signals.zeroed_at_rest:
        settings = replace(settings, zero_sigma_rad=REST_ZERO_SIGMA_RAD)
    if slow_noises:
        settings = replace(settings, slow_noise_rad=max(min(slow_noises), signals.noise_rad))
    return replace(signals, settings=settings)

"""Before the numbers: what instruments do wrong is found and put right, or left out.

Each look is on what the last one left: mains hum in every channel; signs and units of whole families, on the
still parts; the readings of single channels; and, once the test is found, how families and single channels
follow each other through the motion. Where one family hides the test, the others find it. What was found is
said, with what was done about it. The recording itself is not changed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from daq_app.config.families import FAMILY_NAMES
from daq_app.rocking.analysis.preparation.base import STILL, Base, base_of
from daq_app.rocking.analysis.preparation.compared_families import (
    bending_of,
    follow,
    levels,
    lvdts_cover,
    motion_samples,
    shocks_of,
    timing,
)
from daq_app.rocking.analysis.preparation.crude_rotations import CrudeRotations, crude_rotations
from daq_app.rocking.analysis.preparation.fusion import fuse
from daq_app.rocking.analysis.preparation.gains import FamilyGains, gains_of
from daq_app.rocking.analysis.preparation.odd_lvdts import odd_lvdts
from daq_app.rocking.analysis.preparation.odd_wire import compared_wires, odd_wire, wire_means
from daq_app.rocking.analysis.preparation.reader import Reader, found_by_others, shows_test
from daq_app.rocking.analysis.preparation.signals import Lead, Signals, TestTimes
from daq_app.rocking.analysis.preparation.unfit_channels import unfit_channels
from daq_app.rocking.families import unfit_words, words
from daq_app.rocking.families.channels.hum import find_hum
from daq_app.rocking.families.channels.noise import slow_noise
from daq_app.rocking.families.finding import FamilyFinding, families_left_out
from daq_app.rocking.families.response import Response
from daq_app.rocking.families.scales import wrong_scales
from daq_app.rocking.families.shocks import ShockTiming
from daq_app.rocking.families.treated import Corrections, held_in_memory, without_hum
from daq_app.rocking.geometry.noise import white_noise
from daq_app.rocking.motion.bending import Bending
from daq_app.rocking.motion.swings import REST_ZERO_SIGMA_RAD
from daq_app.rocking.record import TestRecord

_NOTABLE_HUM_NOISES = 1.5
"""Hum above this many times a channel's noise is a warning; below it is taken out and remarked. Ordinary
laboratories with noise twice the rig file's reach 1."""
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
    rotations = crude_rotations(held)
    scaled, corrections = _put_to_scale(held, rotations)
    if scaled:
        rotations = crude_rotations(corrections.applied(held))
    unfit = unfit_channels(corrections.applied(held), rotations)
    in_steps = frozenset(f.channels[0] for f in unfit.left_out if (f.family, f.kind) == ("wires", "steps"))
    corrected = replace(corrections, left_out=unfit.ids - in_steps).applied(held)
    reader = Reader(from_rest)
    signals, times = reader.read(corrected, "wires")
    if unfit.spoils("wires") and not unfit.spoils("LVDTs"):
        by_lvdts = reader.read(corrected, "lvdts")
        if shows_test(by_lvdts[1]) and lvdts_cover(*by_lvdts):
            signals, times = by_lvdts
    spoiled = [unfit_words.instead_of(f, left_out=signals.lead == "lvdts") for f in unfit.families]
    findings += [*scaled, *unfit.left_out, *spoiled, *unfit.noisy]
    if not shows_test(times):
        elsewhere = found_by_others(corrected, reader)
        if elsewhere is None:
            return Instruments(corrected, signals, times, tuple(findings), None, None, FamilyGains())
        reader, signals, times = elsewhere.reader, elsewhere.signals, elsewhere.times
        findings.append(elsewhere.blamed)
        spoiled += [elsewhere.blamed] if signals.lead == "lvdts" else []
    return _in_step(corrected, signals, times, findings, reader, spoiled=spoiled, in_steps=in_steps)


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
    for family, name in FAMILY_NAMES.items():
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


def _put_to_scale(record: TestRecord, rotations: CrudeRotations) -> tuple[list[FamilyFinding], Corrections]:
    """Signs and units of whole families, from rotations that need no hold to be found."""
    findings, factors = [], {}
    for name, factor in wrong_scales(rotations.rad, rotations.rate_hz).items():
        family = words.families_by_name()[name]
        axis = "x" if family == "tiltmeter" else None
        findings.append(words.scale(name, factor))
        factors.update(dict.fromkeys(record.family(family, axis), 1.0 / factor))
    return findings, Corrections(factors=factors)


# -- once the test is found ------------------------------------------------------------------------


def _in_step(
    record: TestRecord,
    signals: Signals,
    times: TestTimes,
    findings: list[FamilyFinding],
    reader: Reader,
    *,
    spoiled: Sequence[FamilyFinding],
    in_steps: frozenset[str],
) -> Instruments:
    """Single wires and the timing of families; read again where something had to be put right.

    `spoiled`: families that do not show the wall, so that one says nothing of the other. `in_steps`: wires
    that go in steps, and are left out once it is known whether they stick.
    """
    comparable = not spoiled
    motion = motion_samples(signals, times)
    bending = bending_of(signals, times, None) if comparable else None
    response = follow(signals, times) if comparable else None
    # Wires that leap may do so with the wall.
    leap_at_most = all((f.family, f.kind) == ("wires", "leaps") for f in spoiled)
    odd_ones = odd_lvdts(signals, motion) if leap_at_most else []
    hidden = not leap_at_most or bending is not None or bool(odd_ones)
    base = STILL if hidden else base_of(record, signals, times, response, leaping=bool(spoiled))
    if base.moves:
        # Wires that step with the wall say nothing of the LVDTs, and nothing of each other.
        findings, comparable, response = [f for f in findings if f not in spoiled], False, None
    wires_tell = comparable or (signals.lead == "wires" and not base.moves)
    means = wire_means(signals, motion) if wires_tell else None
    wires = compared_wires(signals, means)
    odd = odd_wire(signals, means, wires, bends=bending is not None, turns=base.steps.turn_rad > 0.0)
    findings, left_out = _with_odd(findings, odd, odd_ones, in_steps)
    shocks = shocks_of(record, signals, times)
    found, lead, earlier, bending = _between_families(record, signals, times, response, shocks, bending, base)
    if base.steps.turn_rad > 0.0:
        found.append(unfit_words.turns(base.steps.turn_rad))
    findings += found
    changed = Corrections(left_out=left_out, earlier_s=earlier)
    if changed.left_out or changed.earlier_s or lead != signals.lead:
        corrected = changed.applied(record)
        # Tiltmeters on a wall that bends took a zero that may be off, and confirm no hold by it.
        again = reader if bending is None else replace(reader, ask_tiltmeters=False)
        signals_again, times_again = again.read(corrected, lead)
        if times_again.impacts_s:
            record, signals, times = corrected, signals_again, times_again
            if wires is not None:
                wires = compared_wires(signals, wire_means(signals, motion_samples(signals, times)))
            response = follow(signals, times) if comparable else None
            shocks = shocks_of(record, signals, times)
        else:
            findings = [
                words.not_done(finding) if _needs_reading(finding) else finding for finding in findings
            ]
    if response is not None and bending is None:
        findings += levels(signals, times, response)
    return Instruments(
        record, _fused_without(_with_errors(signals, times), families_left_out(findings)), times,
        tuple(findings), response, shocks,
        gains_of(signals, times, wires), bending,
    )  # fmt: skip


def _with_odd(
    findings: list[FamilyFinding],
    wire: FamilyFinding | None,
    lvdts: list[FamilyFinding],
    in_steps: frozenset[str],
) -> tuple[list[FamilyFinding], frozenset[str]]:
    """The findings with those of single channels that are odd, and all channels that are left out now."""
    if wire is not None and (wire.kind == "hysteresis" or not in_steps.intersection(wire.channels)):
        # A wire that jumps on and on goes in steps as well.
        findings = [f for f in findings if f.kind != "steps" or f.channels != wire.channels]
        findings.append(wire)
        in_steps = in_steps.union(wire.channels)
    return findings + lvdts, in_steps.union(*(finding.channels for finding in lvdts))


def _between_families(
    record: TestRecord,
    signals: Signals,
    times: TestTimes,
    response: Response | None,
    shocks: ShockTiming | None,
    bending: Bending | None,
    base: Base,
) -> tuple[list[FamilyFinding], Lead, dict[str, float], Bending | None]:
    """Findings, the family that leads, by how much channels are moved earlier, and how the wall bends."""
    # Delays and first orders are no answer to what the wall or its base does between the two families.
    if base.moves:
        lead: Lead = "lvdts" if lvdts_cover(signals, times) else "wires"
        left_out = lead == "lvdts"
        if base.slip is not None:
            told = unfit_words.slips(base.slip.slip_m, base.slip.friction, left_out=left_out)
        else:
            told = unfit_words.slides(base.steps.slide_m, left_out=left_out)
        return [told], lead, {}, None
    if bending is not None:
        lead = "lvdts" if lvdts_cover(signals, times) else "wires"
        told = words.bending(bending.frequency_hz, bending.rms_rad, left_out=lead == "lvdts")
        return [told], lead, {}, bending
    if response is None:
        return [], signals.lead, {}, None
    found, lead, earlier = timing(record, signals, times, response, shocks)
    # A family that is slow or late, even by less than is named, may leave more between the two than
    # the ringing of a wall that bends.
    bending = bending_of(signals, times, response)
    if bending is not None:
        blamed = any("LVDTs" in finding.family for finding in found)
        lead = "wires" if blamed or not lvdts_cover(signals, times) else "lvdts"
        found.append(words.bending(bending.frequency_hz, bending.rms_rad, left_out=lead == "lvdts"))
    return found, lead, earlier, bending


def _needs_reading(finding: FamilyFinding) -> bool:
    """Whether the test is read again for what is done about it: LVDTs are left out by not being asked."""
    if finding.treatment == "left out":
        return finding.family == "wires"
    return finding.treatment == "put in step"


def _fused_without(signals: Signals, left_out: frozenset[str]) -> Signals:
    """The same whose best rotation has no part of a family that is left out."""
    if signals.joint is None or not left_out & {"wires", "LVDTs"}:
        return signals
    wires, lvdts = (
        np.full(rotation.size, np.nan) if name in left_out else rotation
        for name, rotation in (("wires", signals.wire_rotation_rad), ("LVDTs", signals.joint.rotation_rad))
    )
    noises = (white_noise(rotation) for rotation in (signals.wire_rotation_rad, signals.joint.rotation_rad))
    return replace(signals, fused=fuse(wires, lvdts, *noises))


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

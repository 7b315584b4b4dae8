"""The checks of the motion against a rigid block, on the families that followed a test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from daq_app.rocking.analysis.families_table import LEADS, other_is_blamed
from daq_app.rocking.analysis.own_body import OwnTrack, with_own_body
from daq_app.rocking.analysis.preparation.instruments import Instruments
from daq_app.rocking.analysis.results import JointSummary
from daq_app.rocking.analysis.tracks import FamilyTracks
from daq_app.rocking.families import unfit_words, words
from daq_app.rocking.families.block_checks import (
    alpha_findings,
    duration_findings,
    is_rigid_block,
    p_findings,
    pattern_findings,
    pivot_findings,
    weaker_change_by_speed,
    weaker_hop,
)
from daq_app.rocking.families.body import body_of
from daq_app.rocking.families.finding import FamilyFinding
from daq_app.rocking.families.floor import shaking_of_floor
from daq_app.rocking.motion.impact_pattern import ImpactPattern, impact_pattern
from daq_app.rocking.theory.block import RigidBlock

_MADE_BY_A_DRIFT: Final = ("side", "duration", "pause", "hop")
"""A zero that moves makes leans to one side longer and faster than those to the other."""
_MADE_BY_SLIPS: Final = ("loss", "pause", "hop", "duration")
"""An edge that slips between impacts makes half-cycles shorter, and slow impacts lose more speed."""

_SETTLED_S: Final = 0.5
"""Time after the last impact in which a wall's own ringing dies away."""


def pattern_of(
    instruments: Instruments, tracks: FamilyTracks, own: OwnTrack, level_findings: Sequence[FamilyFinding]
) -> ImpactPattern:
    """How the impacts of the test differ, by both families together where no instrument is to blame.

    `own`: the family that leads, with the wall's own p and α.

    Sides are those of the family that leads: where the families' zeros differ, what is fused of them leans.
    """
    signals = instruments.signals
    pattern = impact_pattern(own.track)
    blamed = other_is_blamed([*instruments.findings, *level_findings], tracks.other_name)
    if tracks.fused is None or signals.fused is None or blamed:
        return pattern
    fused = with_own_body(tracks.fused, signals.time_s, signals.fused.rotation_rad)
    return replace(impact_pattern(fused.track), by_side=pattern.by_side)


def wall_findings(
    instruments: Instruments,
    tracks: FamilyTracks,
    joint: JointSummary | None,
    level_findings: Sequence[FamilyFinding],
    pattern: ImpactPattern,
) -> list[FamilyFinding]:
    """What the wall does that a rigid block on its edges does not.

    A family whose instruments are to blame already (`level_findings` are those of θ0) is not asked.
    """
    lead, other = instruments.signals.lead, tracks.other_name
    families = {LEADS[lead]: tracks.lead}
    findings = [*instruments.findings, *level_findings]
    if tracks.other is not None and not other_is_blamed(findings, other):
        families[LEADS[other]] = tracks.other
    bodies = {name: body_of(track, 0.0) for name, track in families.items()}
    found = [*pattern_findings(pattern), *duration_findings(bodies)]
    if not any(finding.kind == "speed" for finding in found):
        found += weaker_change_by_speed(pattern)
    if not any(finding.kind == "hop" for finding in found):
        found += weaker_hop(pattern)
    if any(f.kind == "drift" and f.treatment == "none" and LEADS[lead] in f.family for f in findings):
        found = [finding for finding in found if finding.kind not in _MADE_BY_A_DRIFT]
    if any(f.kind == "slip" for f in findings):
        found = [finding for finding in found if finding.kind not in _MADE_BY_SLIPS]
    found += alpha_findings(bodies[LEADS[lead]], tracks.lead)
    if is_rigid_block([*findings, *found]):
        found += p_findings(bodies[LEADS[lead]], tracks.lead.settings.p_rad_s)
    if not tracks.lead.fell_freely:
        found.append(words.slow_release(tracks.lead.misfit_of_fall))
    found += _floor(instruments)
    if joint is not None:
        block = RigidBlock.from_specimen(instruments.record.rig.specimen)
        found += pivot_findings(block, joint.inset_left_m, joint.inset_right_m)
    return found


def _floor(instruments: Instruments) -> list[FamilyFinding]:
    """Whether the floor shakes, by the accelerometers at rest; a wall that bends rings on there by itself."""
    rest, record = instruments.times.rest, instruments.record
    ids = record.family("accelerometer", "x")
    if rest is None or not ids or instruments.bending is not None:
        return []
    start = rest.start + round(_SETTLED_S * record.rate_hz)
    if start >= rest.stop:
        return []
    heights_m = np.array([record.rig.channel(name).position_m[2] for name in ids])
    rms = shaking_of_floor(record.load(ids, start, rest.stop), heights_m, record.rate_hz)
    return [] if rms is None else [unfit_words.shaking_floor(rms)]

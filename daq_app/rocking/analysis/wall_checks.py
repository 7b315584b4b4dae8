"""The checks of the motion against a rigid block, on the families that followed a test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.analysis.families_table import LEADS, other_is_blamed
from daq_app.rocking.analysis.preparation.instruments import Instruments
from daq_app.rocking.analysis.results import JointSummary
from daq_app.rocking.analysis.tracks import FamilyTracks
from daq_app.rocking.families import words
from daq_app.rocking.families.block_checks import (
    alpha_findings,
    duration_findings,
    pattern_findings,
    pivot_findings,
    weaker_change_by_speed,
    weaker_hop,
)
from daq_app.rocking.families.body import body_of
from daq_app.rocking.families.finding import FamilyFinding
from daq_app.rocking.motion.impact_pattern import ImpactPattern, impact_pattern
from daq_app.rocking.motion.swings import MotionTrack
from daq_app.rocking.theory.block import RigidBlock

Floats = NDArray[np.float64]

_MADE_BY_A_DRIFT: Final = ("side", "duration", "pause", "hop")
"""A zero that moves makes leans to one side longer and faster than those to the other."""
_P_SHARE: Final = 0.1
_ALPHA_SHARE: Final = 0.2
"""p and α by the half-cycles that are further from the survey's than this are no property of the wall."""


def pattern_of(
    instruments: Instruments, tracks: FamilyTracks, level_findings: Sequence[FamilyFinding]
) -> ImpactPattern:
    """How the impacts of the test differ, by both families together where no instrument is to blame.

    Sides are those of the family that leads: where the families' zeros differ, what is fused of them leans.
    """
    signals = instruments.signals
    pattern = impact_pattern(_with_own_body(tracks.lead, signals.time_s, signals.rotation_rad))
    blamed = other_is_blamed([*instruments.findings, *level_findings], tracks.other_name)
    if tracks.fused is None or signals.fused is None or blamed:
        return pattern
    fused = impact_pattern(_with_own_body(tracks.fused, signals.time_s, signals.fused.rotation_rad))
    return replace(fused, by_side=pattern.by_side)


def _with_own_body(track: MotionTrack, time_s: Floats, rotation_rad: Floats) -> MotionTrack:
    """Half-cycles fitted with the p and α that they show; as they are where those are no wall's."""
    body, nominal = body_of(track, 0.0), track.settings
    if (
        body is not None
        and abs(body.p_rad_s / nominal.p_rad_s - 1.0) < _P_SHARE
        and abs(body.alpha_rad / nominal.alpha_rad - 1.0) < _ALPHA_SHARE
    ):
        return track.fitted_again(body.p_rad_s, body.alpha_rad, time_s, rotation_rad)
    return track


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
    found += alpha_findings(bodies[LEADS[lead]], tracks.lead)
    if not tracks.lead.fell_freely:
        found.append(words.slow_release(tracks.lead.misfit_of_fall))
    if joint is not None:
        block = RigidBlock.from_specimen(instruments.record.rig.specimen)
        found += pivot_findings(block, joint.inset_left_m, joint.inset_right_m)
    return found

"""What in the motion itself speaks against a rigid block that turns about its edges with one r.

Instruments may all agree while the wall twists, bounces, rubs or yields: r by the decay is then no property
of its impacts. Each check compares the motion with what Housner's block does, by the errors of the
half-cycles and the scatter of r that the test itself shows.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from daq_app.rocking.estimators import RestitutionEstimate, estimate_all
from daq_app.rocking.families import words
from daq_app.rocking.families.body import SURVEY_P_SHARE, BodyEstimate
from daq_app.rocking.families.finding import FamilyFinding
from daq_app.rocking.motion.impact_pattern import Coefficient, ImpactPattern
from daq_app.rocking.theory.block import RigidBlock

if TYPE_CHECKING:
    from daq_app.rocking.motion.motion_fit import MotionFit
    from daq_app.rocking.motion.swings import MotionTrack

R_TOLERANCE: Final = 0.002
"""What r may be off by with nothing said. Changes of r within a test count from twice this on, for the r of
the whole lies between its ends."""
_NO_RIGID_BLOCK: Final = frozenset({"speed", "side", "loss", "pause", "hop", "duration", "bending"})
"""Kinds of finding by which the wall is no rigid block with one r, so that a fit finds no p and α of it."""
_CHANCE: Final = 0.001
"""Probability by which scatter alone may name a change: four are looked for, and of sound tests fewer than
2 % shall be doubted for whatever reason. Raising it names walls whose r scatters."""
_CHANCE_OF_SPEED: Final = 0.005
"""The same for a change of r with speed in a finished test: while the wall rocks it is looked for at every
impact, and chance has many turns. Of 900 sound tests 11 have a chance below 0.01 for a change that counts,
and 5 below this. Raising it names sound walls whose impacts happen to differ."""
_SPEED_IN_ERROR: Final = 0.0025
"""What a change of r with speed adds to the standard error of r that is a warning, however likely chance
makes it. Slopes of 0.05 s/rad add 0.003 and more; chance makes 0.002 in one sound test of a hundred, and this
in none of 391."""
_CHANCE_OF_HOP: Final = 0.01
"""The same for a hop in a finished test, which noise makes more seldom than it should: of 900 sound tests one
has a chance below 0.02. Lowering it leaves hops of 2 ms, which move r by 0.01, to a note in noisy
laboratories."""
_CHANCE_TOLD: Final = 0.05
"""The same for a hop that is told, and in the errors of r, without a warning: noise may hide what moves r by
0.01. Two of 900 sound tests have a chance below it."""
_DURATION_SIGMAS: Final = 4.0
"""rms by which durations deviate from the block's, in their own errors, that is named; sound ones reach 2."""
_FEWEST_DURATIONS: Final = 6
"""Half-cycles below which α and p take up what deviates."""
_ALPHA_SHARE: Final = 0.03
"""Difference of the motion's α from the survey's that is looked at: bodies that are off by 1 % (assumed) and
a calibration stay below it. Lowering it tells what moves CRT by less than 0.0002."""
_ALPHA_SIGMAS: Final = 4.0
_P_SIGMAS: Final = 3.0
"""Difference of the motion's p from the survey's, in standard errors of both, that is told: chance makes it
in three sound tests of a thousand, and r does not feel it."""
_P_NAMED_SIGMAS: Final = 5.0
"""The same that is a warning. Raising it leaves sampling rates that are wrong by 4 % to a note."""
_CRT_TOLD: Final = 2e-4
"""What α makes of CRT that is told and counted in its error; half of `R_TOLERANCE` is a warning, for scatter
of r between impacts comes to it."""

ORDINARY_SCATTER: Final = 0.0065
"""Relative scatter of r from impact to impact up to which nothing is said (assumed: `campaign simulate` draws
0.004). Lowering it names sound walls whose impacts happen to differ: with 0.006 seven of 600 drawn tests that
scatter by 0.006 at most. Raising it leaves walls that scatter by 0.01 to the error of r, which holds it."""

_MISFIT_NAMED: Final = 2.5
"""Misfit of the whole motion, in noises, that is named: of 400 sound tests one left 2.2, all others less
than 2. Raising it leaves tilted bases and cables unnamed, which move r by the fit by 0.003 to 0.008."""

_LEAN_NAMED: Final = 2e-3
"""Half the difference of α of both sides, rad, that is named: what a base is off level by, and a mass off the
middle (`motion_model.LEAN_PRIOR_RAD`). Raising it to 4 mrad leaves what moves r by one method by 0.002."""

_EDGE_NAMED_M: Final = 1e-3
"""Inset of edges that yield that is named: p and α of a block on sharp edges that is laid through the motion
are 0.25 and 0.3 % off by it. Raising it leaves such edges unnamed, lowering it names those that move p by no
more than its error."""
_EDGE_SIGMAS: Final = 3.5
"""The same in the standard errors that it has on sharp edges: chance makes it on two of ten thousand of them.
Raising it to 4 leaves one in eight unnamed of those walls with edges of 6 mm that are named."""


def is_rigid_block(findings: Iterable[FamilyFinding]) -> bool:
    """Whether no warning says that the wall is no rigid block with one r."""
    return not any(f.kind in _NO_RIGID_BLOCK and f.severity == "warning" for f in findings)


def pattern_findings(pattern: ImpactPattern) -> list[FamilyFinding]:
    """r that changes with speed or with side, speed lost between impacts, impacts that take time, hops."""
    findings = []
    change = pattern.r_slow - pattern.r_fast
    if _named(pattern.by_speed) and abs(change) > 2.0 * R_TOLERANCE:
        findings.append(words.r_by_speed(pattern.r_fast, pattern.r_slow))
    side = pattern.by_side
    middle = 0.5 * (pattern.r_fast + pattern.r_slow)
    if side is not None and _named(side) and middle * abs(side.value) > 2.0 * R_TOLERANCE:
        findings.append(words.r_by_side(*(middle * math.exp(sign * side.value / 2.0) for sign in (1, -1))))
    kept = pattern.between
    # No half-cycle gains speed by itself: only one side counts.
    if kept is not None and kept.value < -R_TOLERANCE and kept.chance / 2.0 < _CHANCE:
        findings.append(words.lost_between(1.0 - math.exp(kept.value)))
    pause = pattern.pause
    if pause is not None and _named(pause):
        hop = pattern.hop_s * pattern.slowed_1_s
        share = pause.value * pattern.slowed_1_s
        if hop > R_TOLERANCE:
            findings.append(words.hop_at_impacts(pattern.hop_s, hop))
        elif share > R_TOLERANCE:
            findings.append(words.pause_at_impacts(pause.value, share))
    return findings


def weaker_change_by_speed(pattern: ImpactPattern) -> list[FamilyFinding]:
    """A change of r with speed in a finished test that `pattern_findings` does not name.

    It is named where chance seldom makes it, and told wherever half of it is more than what may go unsaid: as
    a warning where it adds much to the standard error of r, however likely chance makes it.
    """
    speed = pattern.by_speed
    if speed is None or 0.5 * pattern.change_with_speed <= R_TOLERANCE:
        return []
    if speed.chance < _CHANCE_OF_SPEED:
        return [words.r_by_speed(pattern.r_fast, pattern.r_slow)]
    notable = pattern.sigma_r_by_speed > _SPEED_IN_ERROR
    return [words.r_perhaps_by_speed(pattern.r_fast, pattern.r_slow, speed.sigma, notable=notable)]


def weaker_hop(pattern: ImpactPattern) -> list[FamilyFinding]:
    """A hop in a finished test that `pattern_findings` does not name.

    It is named where noise seldom makes it, and told where it does so less often than once in twenty tests.
    """
    share = pattern.hop_s * pattern.slowed_1_s
    if pattern.pause is None or pattern.pause.chance >= _CHANCE_TOLD or share <= R_TOLERANCE:
        return []
    if pattern.pause.chance < _CHANCE_OF_HOP:
        return [words.hop_at_impacts(pattern.hop_s, share)]
    return [words.perhaps_hops(pattern.hop_s, share)]


def misfit_findings(
    fit: MotionFit | None, others: Iterable[FamilyFinding], r0_m: float
) -> list[FamilyFinding]:
    """What the fit of the whole motion leaves, where that is more than noise; `others`: what else was found.

    It is no warning of its own where a warning says why. Where nothing is left, what the wall leans by and
    what its edges yield by; `r0_m`: from an edge to the centre of mass, m.
    """
    if fit is None:
        return []
    if fit.explains_the_motion:
        return [] if _is_explained(others) else _shape_findings(fit, r0_m)
    notable = fit.residual_rad > _MISFIT_NAMED * fit.noise_rad and not _is_explained(others)
    return [words.not_housner_motion(fit.residual_rad, fit.noise_rad, notable=notable)]


def _shape_findings(fit: MotionFit, r0_m: float) -> list[FamilyFinding]:
    findings = []
    if abs(fit.lean_rad) > _LEAN_NAMED:
        findings.append(words.alpha_by_side(fit.lean_rad))
    named_rad = max(_EDGE_NAMED_M / r0_m, _EDGE_SIGMAS * fit.sigma_inset_if_sharp_rad)
    if fit.inset_rad > named_rad:
        findings.append(words.edges_yield(fit.inset_rad * r0_m, fit.sigma_inset_rad * r0_m))
    return findings


def scatter_findings(
    eav: RestitutionEstimate, crt: RestitutionEstimate, others: Iterable[FamilyFinding]
) -> list[FamilyFinding]:
    """r that scatters more than it ordinarily does, by speeds and by peaks; `others`: what else was found.

    It does so for sure, or most likely and with an r that is known worse than what may go unsaid. A wall or a
    zero that does something else at each side or speed makes r scatter as well: that is named.
    """
    if _is_explained(others) or not eav.standard_error or not crt.standard_error:
        return []
    scatter, error = min(eav.scatter, crt.scatter), min(eav.standard_error, crt.standard_error)
    surely = min(eav.least_scatter, crt.least_scatter) > ORDINARY_SCATTER
    if surely or (scatter > ORDINARY_SCATTER and error > R_TOLERANCE):
        return [words.r_scatters(scatter, eav.standard_error)]
    return []


def _is_explained(others: Iterable[FamilyFinding]) -> bool:
    """Whether something is named that scatters r and bends the motion: a moving zero, no rigid block."""
    found = list(others)
    return not is_rigid_block(found) or any(finding.kind == "drift" for finding in found)


def _named(coefficient: Coefficient | None) -> bool:
    return coefficient is not None and coefficient.chance < _CHANCE


def duration_findings(bodies: Mapping[str, BodyEstimate | None]) -> list[FamilyFinding]:
    """Families, by name, in which the durations of half-cycles do not follow from their peaks."""
    findings = []
    for family, body in bodies.items():
        if body is None or body.half_cycles < _FEWEST_DURATIONS:
            continue
        sigmas = math.sqrt(body.misfit)
        if sigmas > _DURATION_SIGMAS:
            findings.append(words.not_housner_durations(family, sigmas))
    return findings


def alpha_findings(body: BodyEstimate | None, track: MotionTrack) -> list[FamilyFinding]:
    """A survey whose α is not that of the motion, told where CRT is off by it, and named where by much."""
    off = survey_off(body, track)
    if off is None:
        return []
    return [words.alpha_of_survey(off.share, off.shift, notable=off.is_notable)]


@dataclass(frozen=True, slots=True)
class SurveyOff:
    """The α that the wall rocks with against the survey's."""

    share: float
    """α of the motion over that of the survey, less one."""
    shift: float
    """CRT with the survey's α less CRT with the motion's."""

    @property
    def is_notable(self) -> bool:
        """Whether it is a warning: scatter of r between impacts comes to half of that."""
        return abs(self.shift) > 0.5 * R_TOLERANCE


def survey_off(body: BodyEstimate | None, track: MotionTrack) -> SurveyOff | None:
    """How far the survey's α, that of `track`, is off the motion's; None where CRT is hardly off by it.

    Only durations that a block explains tell an α.
    """
    survey_rad = track.settings.alpha_rad
    if body is None or not math.sqrt(body.misfit) <= _DURATION_SIGMAS:
        return None
    off_rad = abs(body.alpha_rad - survey_rad)
    if not off_rad > max(_ALPHA_SHARE * survey_rad, _ALPHA_SIGMAS * body.sigma_alpha_rad):
        return None
    series = [track.crt_exact_series(), track.crt_exact_series(body.alpha_rad)]
    by_survey, by_motion = (estimate.r for estimate in estimate_all(series))
    if by_survey is None or by_motion is None or abs(by_survey - by_motion) <= _CRT_TOLD:
        return None
    return SurveyOff(body.alpha_rad / survey_rad - 1.0, by_survey - by_motion)


def p_findings(body: BodyEstimate | None, survey_p_rad_s: float) -> list[FamilyFinding]:
    """A p of the motion that the survey's does not allow for: a wrong body, or a wrong sampling rate.

    Only durations that a block explains tell a p.
    """
    if body is None or not math.sqrt(body.misfit) <= _DURATION_SIGMAS:
        return []
    share = body.p_rad_s / survey_p_rad_s - 1.0
    sigmas = abs(share) / math.hypot(body.sigma_p_rad_s / survey_p_rad_s, SURVEY_P_SHARE)
    if not sigmas > _P_SIGMAS:
        return []
    return [words.p_of_survey(share, body.p_rad_s, survey_p_rad_s, notable=sigmas > _P_NAMED_SIGMAS)]


def pivot_findings(block: RigidBlock, inset_left_m: float, inset_right_m: float) -> list[FamilyFinding]:
    """Pivots so far inside the edges that the largest r of a rigid block is another one; NaN: not known."""
    inset = 0.5 * (inset_left_m + inset_right_m)
    if not 0.0 < inset < block.base_width_m / 2.0:
        return []
    r_max = block.with_pivots_inside(inset).r_max
    if abs(r_max - block.r_max) <= R_TOLERANCE:
        return []
    return [words.pivots_inside(inset_left_m, inset_right_m, r_max, block.r_max)]

"""One r from everything and how far it is to be believed: what each family says, who disagrees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy  # its `special` is loaded with the first use: the window starts without it

from daq_app.rocking.estimators import DecaySeries, RestitutionEstimate, estimate_all
from daq_app.rocking.families.finding import FamilyFinding

Trust = Literal["good", "remarks", "doubtful"]
"""All agrees; something was put right, left out, or does not touch r; families disagree on r."""

SHARED = 0.9
"""Correlation of the errors of EAV and CRT on one motion: both follow the scatter of r between impacts."""
_FAMILIES_APART = 0.0015
"""Difference of r between wires and LVDTs below which nothing is said, however small the errors."""
_METHODS_APART = 0.002
_SIGMAS = 4.0
_MOVES_NO_R = frozenset({"gain", "late", "scatter", "misfit", "alpha", "lean", "edge", "p", "noise", "turn"})
_MODEL_R = 5e-5
"""Standard uncertainty of r that the fits of half-cycles leave on exact motion."""


@dataclass(frozen=True, slots=True)
class FamilyView:
    """What one family says of the test; NaN where it says nothing."""

    family: str
    theta0_rad: float = math.nan
    sigma_theta0_rad: float = math.nan
    eav: float = math.nan
    sigma_eav: float = math.nan
    crt: float = math.nan
    sigma_crt: float = math.nan
    alpha_rad: float = math.nan
    sigma_alpha_rad: float = math.nan
    p_rad_s: float = math.nan
    sigma_p_rad_s: float = math.nan
    impacts: int = 0
    """Half-cycles that could be fitted, or shocks that were seen."""
    late_s: float = math.nan
    """How late its impacts are against those that r was found with, after what was put in step."""
    interval95_eav: tuple[float, float] | None = None
    interval95_crt: tuple[float, float] | None = None
    used: bool = False
    """Whether r or θ0 rests on it."""
    remarks: tuple[str, ...] = ()
    """Kinds of what was found about it."""


@dataclass(frozen=True, slots=True)
class RVerdict:
    """r with everything that is known of its error."""

    r: float | None
    standard_error: float | None
    interval95: tuple[float, float] | None
    trust: Trust
    used: tuple[str, ...]
    """Families behind r."""
    left_out: tuple[str, ...]
    reasons: tuple[str, ...]
    """Sentences: what there is to remark or to doubt; none where it is good."""


def compare_series(wires: DecaySeries, lvdts: DecaySeries) -> tuple[float, float] | None:
    """Difference of r, wires less LVDTs, and its standard error; None where they share too few values.

    Taken value by value, so that the scatter of r, which both show alike, does not count.
    """
    usable = wires.usable & lvdts.usable
    if wires.values.shape != lvdts.values.shape or np.count_nonzero(usable) < 4 or not wires.points:
        return None
    apart = replace(
        wires,
        values=np.where(usable, wires.values - lvdts.values, 0.0),
        variances=np.where(usable, wires.variances + lvdts.variances, 0.0),
        usable=usable,
        may_scatter=False,
    )
    ratio, typical = estimate_all([apart, wires])
    if ratio.r is None or ratio.standard_error is None or typical.r is None:
        return None
    return typical.r * (ratio.r - 1.0), typical.r * ratio.standard_error


def families_apart(method: str, difference: tuple[float, float] | None) -> str | None:
    """A sentence where wires and LVDTs give different r by one method, beyond their errors."""
    if difference is None:
        return None
    value, sigma = difference
    if abs(value) <= max(_FAMILIES_APART, _SIGMAS * sigma):
        return None
    return (
        f"wires and LVDTs give {method} that differ by {value:+.4f} ± {sigma:.4f}: one of them is slow, bent "
        "or filtered, or the joint moves as the wall does not"
    )


def methods_apart(eav: RestitutionEstimate, crt: RestitutionEstimate) -> str | None:
    """A sentence where EAV and CRT differ beyond their errors."""
    if eav.r is None or crt.r is None or not eav.standard_error or not crt.standard_error:
        return None
    difference = eav.r - crt.r
    sigma = math.hypot(eav.standard_error, crt.standard_error, 5e-4)
    if abs(difference) <= max(_SIGMAS * sigma, _METHODS_APART):
        return None
    return (
        f"EAV and CRT differ by {difference:+.4f} ({abs(difference) / sigma:.0f} σ): the motion is not "
        "Housner's, or an instrument bends it"
    )


def with_change_by_speed(estimate: RestitutionEstimate, sigma: float) -> RestitutionEstimate:
    """The estimate for r at any impact; `sigma`: what a change of r with speed adds to its standard error."""
    return _widened(estimate, sigma)


def with_findings(estimate: RestitutionEstimate, findings: Sequence[FamilyFinding]) -> RestitutionEstimate:
    """The estimate for r at the impacts, where the wall does what is in `findings`: as in the verdict."""
    shares = [_share_of_r(finding, estimate.r) for finding in findings] if estimate.r is not None else []
    return _widened(with_alpha_of_survey(estimate, findings), *shares)


def with_alpha_of_survey(
    estimate: RestitutionEstimate, findings: Sequence[FamilyFinding]
) -> RestitutionEstimate:
    """CRT with the error of a survey whose α is not the wall's; any other estimate as it is."""
    if not estimate.method.startswith("CRT"):
        return estimate
    return _widened(estimate, *(finding.size for finding in findings if finding.kind == "alpha"))


def _widened(estimate: RestitutionEstimate, *errors: float) -> RestitutionEstimate:
    if estimate.standard_error is None:
        return estimate
    return replace(estimate, standard_error=math.hypot(estimate.standard_error, *errors))


def judge(
    eav: RestitutionEstimate,
    crt: RestitutionEstimate,
    lead: str,
    findings: Sequence[FamilyFinding],
    disagreements: Sequence[str],
) -> RVerdict:
    """The value by both methods from the family that leads, and whether anything speaks against it.

    `crt` is that of the exact potential: the paper's linearised energy makes r too large by 0.0001 to 0.0002.
    """
    left_out = tuple(
        dict.fromkeys(
            ", ".join(finding.channels) or finding.family
            for finding in findings
            if finding.treatment == "left out"
        )
    )
    open_findings = [
        f for f in findings if f.treatment == "none" and f.severity == "warning" and _touches_r(f)
    ]
    reasons = tuple(dict.fromkeys([*disagreements, *(f.text for f in findings if f.severity == "warning")]))
    trust: Trust = "good"
    if disagreements or open_findings:
        trust = "doubtful"
    elif reasons:
        trust = "remarks"
    known = [e for e in (eav, crt) if e.r is not None and e.standard_error is not None]
    if not known:
        return RVerdict(None, None, None, "doubtful", (lead,), left_out, reasons)
    values = np.array([e.r for e in known], dtype=np.float64)
    errors = np.maximum(np.array([e.standard_error for e in known], dtype=np.float64), 1e-6)
    weights = 1.0 / errors**2
    weights /= weights.sum()
    r = float(weights @ values)
    covariance = np.outer(errors, errors) * (SHARED + (1.0 - SHARED) * np.eye(errors.size))
    error = math.hypot(math.sqrt(float(weights @ covariance @ weights)), _MODEL_R)
    if disagreements and values.size > 1:
        error = math.hypot(error, 0.5 * float(np.ptp(values)))
    error = math.hypot(error, *(_share_of_r(f, r) for f in findings if f.treatment == "none"))
    freedom = min(e.degrees_of_freedom for e in known)
    reach = float(scipy.special.stdtrit(freedom, 0.975)) * error
    return RVerdict(r, error, (r - reach, r + reach), trust, (lead,), left_out, reasons)


def _touches_r(finding: FamilyFinding) -> bool:
    """Whether r may be off by it: a gain cancels in EAV and moves CRT by 0.0001 for 1 %; no time is in r.

    What a scatter or noise makes of r is in its error, what the survey's α makes of it in that of CRT, and a
    misfit is in the error of r by the fit alone. r is a ratio of speeds: no p is in it, what a wall leans by
    cancels between the sides, and edges that yield take and give the same at either end of a half-cycle.
    """
    if finding.family in ("tiltmeters", "accelerometers"):
        return False
    return finding.kind not in _MOVES_NO_R


def _share_of_r(finding: FamilyFinding, r: float) -> float:
    """What the r of single impacts may be off the one of the whole test by what the wall does."""
    if finding.kind == "side":
        return 0.5 * abs(finding.size)
    return r * abs(finding.size) if finding.kind in ("loss", "pause", "hop") else 0.0

"""What each family says of a test, side by side, and the verdict of r drawn from it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from daq_app.rocking.analysis.preparation.instruments import Instruments
from daq_app.rocking.analysis.results import ValueWithSigma
from daq_app.rocking.analysis.tracks import FamilyTracks
from daq_app.rocking.estimators import DecaySeries, RestitutionEstimate
from daq_app.rocking.families import words
from daq_app.rocking.families.body import body_of
from daq_app.rocking.families.finding import FamilyFinding, families_left_out
from daq_app.rocking.families.verdict import (
    FamilyView,
    RVerdict,
    compare_series,
    families_apart,
    judge,
    methods_apart,
    with_alpha_of_survey,
    with_change_by_speed,
)
from daq_app.rocking.motion.swings import MotionTrack
from daq_app.rocking.motion.transients import Onset
from daq_app.rocking.record import TestRecord
from daq_app.rocking.theory.block import RigidBlock

LEADS = {"wires": "wires", "lvdts": "LVDTs"}
"""Families that a motion can be read from: the reader's word by the key."""
_ANOTHER_MOTION = ("slow", "late", "bending", "steps", "still", "leaps", "motion", "slide", "slip")
_FOLLOWS_BADLY = (*_ANOTHER_MOTION, "drift")


def families_of(
    record: TestRecord,
    instruments: Instruments,
    tracks: FamilyTracks,
    estimates: Mapping[str, RestitutionEstimate],
    theta0: Mapping[str, ValueWithSigma],
    onsets: Sequence[Onset | None],
) -> tuple[FamilyView, ...]:
    """One row per family that was recorded, and the survey's."""
    findings = instruments.findings
    rows = []
    for name, family in LEADS.items():
        track = tracks.of(name)
        suffix = "" if name == instruments.signals.lead else f"_{name}"
        if track is not None and f"eav{suffix}" in estimates:
            eav, crt = estimates[f"eav{suffix}"], estimates[f"crt{suffix}"]
            family_theta0 = theta0.get(name)
            rows.append(_rotation_view(family, instruments, track, tracks.lead, eav, crt, family_theta0))
    if "tiltmeters" in theta0:
        value = theta0["tiltmeters"]
        used = "tiltmeters" not in families_left_out(findings)
        rows.append(FamilyView("tiltmeters", value.value, value.sigma, used=used))
    if record.family("accelerometer"):
        heard = [(o, t) for o, t in zip(onsets, tracks.lead.impacts_s, strict=True) if o is not None]
        late = float(np.median([onset.time_s - time for onset, time in heard])) if heard else math.nan
        rows.append(FamilyView("accelerometers", impacts=len(heard), late_s=late))
    specimen = RigidBlock.from_specimen(record.rig.specimen)
    rows.append(FamilyView("survey", alpha_rad=specimen.alpha0_rad, p_rad_s=record.rig.specimen.p_rad_s))
    return tuple(replace(row, remarks=_remarks(row.family, findings)) for row in rows)


def _rotation_view(
    family: str,
    instruments: Instruments,
    track: MotionTrack,
    lead: MotionTrack,
    eav: RestitutionEstimate,
    crt: RestitutionEstimate,
    theta0: ValueWithSigma | None,
) -> FamilyView:
    body = body_of(track, instruments.gains.of("lvdts" if family == "LVDTs" else "wires"))
    apart = [
        impact - lead_impact for impact, lead_impact in zip(track.impacts_s, lead.impacts_s, strict=True)
    ]
    return FamilyView(
        family=family,
        theta0_rad=track.theta0_rad if theta0 is None else theta0.value,
        sigma_theta0_rad=track.sigma_theta0_rad if theta0 is None else theta0.sigma,
        eav=math.nan if eav.r is None else eav.r,
        sigma_eav=eav.standard_error or math.nan,
        crt=math.nan if crt.r is None else crt.r,
        sigma_crt=crt.standard_error or math.nan,
        alpha_rad=math.nan if body is None else body.alpha_rad,
        sigma_alpha_rad=math.nan if body is None else body.sigma_alpha_rad,
        p_rad_s=math.nan if body is None else body.p_rad_s,
        sigma_p_rad_s=math.nan if body is None else body.sigma_p_rad_s,
        impacts=sum(arc is not None for arc in track.arcs),
        late_s=float(np.median(apart)) if track is not lead else 0.0,
        interval95_eav=eav.interval95(),
        interval95_crt=crt.interval95(),
        used=track is lead,
    )


def _remarks(family: str, findings: Sequence[FamilyFinding]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(f.kind for f in findings if family in f.family.split(" or ")))


def verdict_of(
    instruments: Instruments,
    tracks: FamilyTracks,
    series: Mapping[str, DecaySeries],
    estimates: Mapping[str, RestitutionEstimate],
    further: Sequence[FamilyFinding],
    sigma_by_speed: float,
) -> tuple[RVerdict, tuple[FamilyFinding, ...]]:
    """The verdict of r, and every finding behind it; `further` are those of θ0 and of the wall.

    `sigma_by_speed`: what a change of r with speed adds to the error of r. It is no disagreement.
    """
    named = {(finding.family, finding.kind) for finding in instruments.findings}
    findings = list(instruments.findings)
    findings += [finding for finding in further if (finding.family, finding.kind) not in named]
    lead, other = instruments.signals.lead, tracks.other_name
    disagreements = []
    if not other_is_blamed(findings, other):
        for method, name in (("eav", "EAV"), ("crt", "CRT")):
            if f"{method}_{other}" in series:
                lead_series, other_series = series[method], series[f"{method}_{other}"]
                wires, lvdts = (lead_series, other_series) if lead == "wires" else (other_series, lead_series)
                disagreement = families_apart(name, compare_series(wires, lvdts))
                if disagreement is not None:
                    disagreements.append(disagreement)
                    findings.append(words.disagreement(disagreement))
    disagreement = methods_apart(estimates["eav"], estimates["crt"])
    if disagreement is not None:
        disagreements.append(disagreement)
        findings.append(words.not_housner(disagreement))
    eav, crt = (with_change_by_speed(estimates[name], sigma_by_speed) for name in ("eav", "crt_exact"))
    crt = with_alpha_of_survey(crt, findings)
    verdict = judge(eav, crt, LEADS[lead], findings, disagreements)
    return verdict, tuple(findings)


def moves_otherwise(finding: FamilyFinding) -> bool:
    """Whether all wires or all LVDTs show another motion than the wall's, and nothing made it the same."""
    return (
        finding.kind in _ANOTHER_MOTION
        and finding.family in LEADS.values()
        and not finding.channels
        and finding.treatment != "put in step"
    )


def other_is_blamed(findings: Sequence[FamilyFinding], other: str) -> bool:
    """Whether the family that does not lead, ``wires`` or ``lvdts``, is known to follow the wall badly.

    A single channel that is left out says nothing of the others.
    """
    return any(
        f.kind in _FOLLOWS_BADLY
        and LEADS[other] in f.family
        and not f.channels
        and f.treatment != "put in step"
        for f in findings
    )

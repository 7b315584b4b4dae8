"""The whole analysis of one recorded test. Same detector, arcs and estimators as online."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.analysis.bias import BiasSettings, method_bias
from daq_app.rocking.analysis.families_table import families_of, moves_otherwise, verdict_of
from daq_app.rocking.analysis.half_cycles import half_cycles_of
from daq_app.rocking.analysis.joint_summary import summarise_joint
from daq_app.rocking.analysis.options import AnalysisOptions
from daq_app.rocking.analysis.own_body import impact_speeds, with_own_body
from daq_app.rocking.analysis.preparation.compared_families import accelerations_of
from daq_app.rocking.analysis.preparation.fusion import Fused
from daq_app.rocking.analysis.preparation.instruments import Instruments, prepare
from daq_app.rocking.analysis.preparation.signals import Signals
from daq_app.rocking.analysis.quality import quality_notes
from daq_app.rocking.analysis.release_rotation import headline_of, levels_apart, theta0_by_family
from daq_app.rocking.analysis.residuals import residuals_after
from daq_app.rocking.analysis.results import Bias, JointSummary, Series, TestAnalysis, Theory
from daq_app.rocking.analysis.tracks import decay_series, estimates_of, follow_families
from daq_app.rocking.analysis.wall_checks import pattern_of, wall_findings
from daq_app.rocking.estimators import FEWEST_POINTS, RestitutionEstimate
from daq_app.rocking.families.block_checks import is_rigid_block, misfit_findings, scatter_findings
from daq_app.rocking.families.finding import FamilyFinding, families_left_out
from daq_app.rocking.families.verdict import judge, with_change_by_speed, with_findings
from daq_app.rocking.geometry.joint import JointMotion
from daq_app.rocking.motion.filtered_peaks import filtered_peaks
from daq_app.rocking.motion.motion_fit import MotionFit, fit_motion
from daq_app.rocking.motion.swings import MotionTrack
from daq_app.rocking.motion.transients import find_onsets
from daq_app.rocking.motion.velocity import VelocityFilter
from daq_app.rocking.record import TestRecord
from daq_app.rocking.theory import classic as theory
from daq_app.rocking.theory.block import RigidBlock

Floats = NDArray[np.float64]

_NO_ESTIMATE = RestitutionEstimate("none", ())


def analyse_record(record: TestRecord, options: AnalysisOptions | None = None) -> TestAnalysis:
    """Analyse one test. `ValueError` in words where the record cannot give rotation at all.

    A record without a release or impact gives `found = False` and a note, never an exception.
    """
    options = options or AnalysisOptions()
    cutoff = options.velocity_cutoff_hz or record.rig.acquisition.velocity_cutoff_hz
    velocity_filter = VelocityFilter(record.rate_hz, cutoff)
    from_rest = not record.tared if options.zero_at_rest is None else options.zero_at_rest
    instruments = prepare(record, from_rest=from_rest)
    signals, times = instruments.signals, instruments.times
    velocity = velocity_filter.velocity(signals.bridged_rad)
    if times.release_s is None or not times.impacts_s:
        return _nothing_found(record, instruments, velocity, velocity_filter, options)
    return _analyse(record, instruments, velocity, velocity_filter, options)


def _analyse(
    record: TestRecord,
    instruments: Instruments,
    velocity: Floats,
    velocity_filter: VelocityFilter,
    options: AnalysisOptions,
) -> TestAnalysis:
    signals, times = instruments.signals, instruments.times
    alone = any(moves_otherwise(finding) for finding in instruments.findings)
    tracks = follow_families(signals, times, fuse=not alone)
    track = tracks.lead
    peaks = filtered_peaks(signals.time_s, lambda start, stop: velocity[start:stop], track.impacts_s)
    series = decay_series(signals, tracks, peaks, velocity_filter)
    estimates = estimates_of(series)
    onsets = find_onsets(accelerations_of(instruments.record, signals), track.impacts_s)
    fit = _fit(signals, track, estimates, instruments.gain_sigma) if options.fit else None
    unfit = families_left_out(instruments.findings, held_as_well=True)
    theta0 = theta0_by_family(signals, track, instruments.gains, instruments.bent_at_rest_rad, unfit)
    joint = _joint(instruments, signals, track)
    bends = instruments.bending is not None
    # Wires and tiltmeters share the bending: that they agree speaks for neither.
    levels = [] if bends else levels_apart(theta0, unfit)
    own = with_own_body(track, signals.time_s, signals.rotation_rad)
    pattern = pattern_of(instruments, tracks, own, levels)
    by_speed = pattern.sigma_r_by_speed
    of_wall = [*levels, *wall_findings(instruments, tracks, joint, levels, pattern)]
    further = _with_what_is_left(instruments, of_wall, estimates, fit)
    verdict, findings = verdict_of(instruments, tracks, series, estimates, further, by_speed)
    estimates = _with_what_was_found(estimates, findings, by_speed)
    fit = None if fit is None else _for_this_wall(fit, findings, by_speed)
    headline = theta0[signals.lead] if bends else headline_of(theta0, signals.lead, unfit)
    speeds = impact_speeds(track, own, signals.time_s, signals.rotation_rad)
    bias = _bias(record, signals, track, estimates, velocity_filter, options)
    analysis = TestAnalysis(
        label=record.label,
        found=True,
        rate_hz=record.rate_hz,
        theta0_rad=headline.value,
        theta0_over_alpha=abs(headline.value) / signals.settings.alpha_rad,
        theta0_by_family=theta0,
        side=1 if track.theta0_rad > 0 else -1,
        release_s=track.release.time_s,
        rest_s=math.nan if times.rest_s is None else times.rest_s,
        half_cycles=half_cycles_of(track, speeds, peaks, onsets, instruments.gain_sigma),
        verdict=verdict,
        families=families_of(record, instruments, tracks, estimates, theta0, onsets),
        findings=findings,
        estimates=estimates,
        fit=fit,
        bias=bias,
        theory=_theory(record, abs(headline.value), estimates["crt"].r, len(times.impacts_s)),
        joint=joint,
        residuals=residuals_after(signals, times.rest),
        noise_rad=signals.noise_rad,
        zero=signals.zero,
        filter_statement=velocity_filter.statement,
        notes=(),
        series=_series(signals, velocity) if options.keep_series else None,
    )
    return replace(analysis, notes=quality_notes(record, signals, times, track, analysis, onsets, findings))


def _with_what_is_left(
    instruments: Instruments,
    found: Sequence[FamilyFinding],
    estimates: Mapping[str, RestitutionEstimate],
    fit: MotionFit | None,
) -> list[FamilyFinding]:
    """The findings, and what they explain of neither the scatter of impacts nor the fit's misfit."""
    others = [*instruments.findings, *found]
    scatter = scatter_findings(estimates["eav"], estimates["crt"], others)
    r0_m = instruments.record.rig.specimen.r0_m
    return [*found, *scatter, *misfit_findings(fit, others, r0_m)]


def _joint(instruments: Instruments, signals: Signals, track: MotionTrack) -> JointSummary | None:
    """The summary of the joint; LVDTs that it was found without, for they are named, are suspects as well."""
    if signals.joint is None:
        return None
    joint = summarise_joint(instruments.record, signals, track)
    named = [f for f in instruments.findings if f.family == "LVDTs" and f.treatment == "left out"]
    left_out = [name for finding in named for name in finding.channels]
    return replace(joint, suspects=tuple(dict.fromkeys([*left_out, *joint.suspects])))


def _for_this_wall(fit: MotionFit, findings: Sequence[FamilyFinding], by_speed: float) -> MotionFit:
    """The fit with errors that hold for r at any impact; p, α and edges have none on a wall that is no block.

    They are then those of the nearest block, and no property of the wall.
    """
    fit = replace(fit, standard_error=math.hypot(fit.standard_error, by_speed))
    if fit.explains_the_motion and is_rigid_block(findings):
        return fit
    return replace(fit, sigma_p_rad_s=math.nan, sigma_alpha_rad=math.nan, sigma_inset_rad=math.nan)


def _with_what_was_found(
    estimates: Mapping[str, RestitutionEstimate], findings: Sequence[FamilyFinding], by_speed: float
) -> dict[str, RestitutionEstimate]:
    """The same r with errors that hold for the findings and for a change with the speed of impacts."""
    return {
        name: with_findings(with_change_by_speed(estimate, by_speed), findings)
        for name, estimate in estimates.items()
    }


def _typical_r(estimates: Mapping[str, RestitutionEstimate]) -> float:
    values = [e.r for e in (estimates["eav"], estimates["crt"]) if e.r is not None]
    return min(float(np.mean(values)), 0.999) if values else 0.9


def _fit(
    signals: Signals, track: MotionTrack, estimates: Mapping[str, RestitutionEstimate], gain_sigma: float
) -> MotionFit | None:
    """Housner's motion laid through the half-cycles; its errors hold the gain of the family."""
    fit = fit_motion(
        signals.time_s,
        signals.rotation_rad,
        release_s=track.release.time_s,
        theta0_rad=track.theta0_rad,
        impacts_s=track.impacts_s,
        peaks_rad=track.peaks_rad,
        speeds_rad_s=track.speeds_before_rad_s,
        r=_typical_r(estimates),
        scatter=max(estimates["eav"].scatter, estimates["crt"].scatter),
        noise_rad=max(signals.noise_rad, signals.settings.slow_noise_rad),
        p_rad_s=signals.settings.p_rad_s,
        alpha_rad=signals.settings.alpha_rad,
    )
    if fit is None:
        return None
    scatter_assumed = min(len(estimates[method].points) for method in ("eav", "crt")) < FEWEST_POINTS
    return replace(
        fit,
        sigma_alpha_rad=math.hypot(fit.sigma_alpha_rad, gain_sigma * fit.alpha_rad),
        degrees_of_freedom=math.inf if scatter_assumed else fit.degrees_of_freedom,
    )


def _bias(
    record: TestRecord,
    signals: Signals,
    track: MotionTrack,
    estimates: Mapping[str, RestitutionEstimate],
    velocity_filter: VelocityFilter,
    options: AnalysisOptions,
) -> Mapping[str, Bias]:
    """Bias of each method on simulated tests like this one; empty where none is asked for."""
    if options.bias_runs <= 0:
        return {}
    return method_bias(
        BiasSettings(
            settings=signals.settings,
            velocity_filter=velocity_filter,
            theta0_rad=track.theta0_rad,
            sigma_theta0_rad=track.sigma_theta0_rad,
            r=_typical_r(estimates),
            impacts=len(track.impacts_s),
            noise_rad=signals.noise_rad,
            with_fit=options.fit,
            runs=options.bias_runs,
            seed=zlib.crc32(record.label.encode()) if options.seed is None else options.seed,
        )
    )


def _theory(record: TestRecord, theta0: float, r: float | None, impacts: int) -> Theory:
    specimen = record.rig.specimen
    block = RigidBlock.from_specimen(specimen)
    shifted = block.semi_rigid(specimen.mortar_compressive_strength_pa, specimen.length_m)
    phi0 = theta0 / block.alpha0_rad
    usable = math.isfinite(phi0) and 0.0 < phi0 < 1.0 and r is not None and r <= 1.0
    n = np.arange(impacts + 1)
    return Theory(
        p_rad_s=specimen.p_rad_s,
        alpha_rad=block.alpha0_rad,
        r_max=block.r_max_rectangular,
        r_max_block=block.r_max,
        semi_rigid_a_m=shifted.a_m,
        semi_rigid_alpha_rad=shifted.alpha0_rad,
        semi_rigid_p_rad_s=shifted.p_rad_s,
        phi_n=tuple(theory.amplitude_after(n, phi0, r).tolist()) if usable and r else (),
        period_n_s=tuple(theory.period_after(n, phi0, r, specimen.p_rad_s).tolist()) if usable and r else (),
    )


def _series(signals: Signals, velocity: Floats) -> Series:
    joint: JointMotion | None = signals.joint
    fused: Fused | None = signals.fused
    empty = np.full(signals.time_s.size, np.nan)
    return Series(
        time_s=signals.time_s,
        rotation_rad=signals.rotation_rad,
        velocity_rad_s=velocity,
        best_rotation_rad=signals.rotation_rad if fused is None else fused.rotation_rad,
        best_sigma_rad=empty if fused is None else fused.sigma_rad,
        neutral_axis_m=empty if joint is None else joint.neutral_axis_m,
        contact_m=empty if joint is None else joint.contact_m,
        twist_rad_per_m=empty if joint is None else joint.twist_rad_per_m,
    )


def _nothing_found(
    record: TestRecord,
    instruments: Instruments,
    velocity: Floats,
    velocity_filter: VelocityFilter,
    options: AnalysisOptions,
) -> TestAnalysis:
    signals, times = instruments.signals, instruments.times
    hold = times.hold_rad
    return TestAnalysis(
        label=record.label,
        found=False,
        rate_hz=record.rate_hz,
        theta0_rad=hold,
        theta0_over_alpha=abs(hold) / signals.settings.alpha_rad,
        theta0_by_family={},
        side=0 if not math.isfinite(hold) else (1 if hold > 0 else -1),
        release_s=math.nan if times.release_s is None else times.release_s,
        rest_s=math.nan,
        half_cycles=(),
        verdict=judge(_NO_ESTIMATE, _NO_ESTIMATE, "wires", instruments.findings, []),
        families=(),
        findings=instruments.findings,
        estimates={},
        fit=None,
        bias={},
        theory=_theory(record, math.nan, None, 0),
        joint=None,
        residuals=None,
        noise_rad=signals.noise_rad,
        zero=signals.zero,
        filter_statement=velocity_filter.statement,
        notes=quality_notes(record, signals, times, None, None, [], instruments.findings),
        series=_series(signals, velocity) if options.keep_series else None,
    )

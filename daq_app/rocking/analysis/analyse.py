"""The whole analysis of one recorded test. Same detector, arcs and estimators as online."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.analysis.bias import BiasSettings, method_bias
from daq_app.rocking.analysis.fusion import Fused, best_value, level
from daq_app.rocking.analysis.joint_summary import summarise_joint
from daq_app.rocking.analysis.quality import quality_notes
from daq_app.rocking.analysis.residuals import residuals_after
from daq_app.rocking.analysis.results import Bias, HalfCycle, Series, TestAnalysis, Theory, ValueWithSigma
from daq_app.rocking.analysis.signals import Signals, TestTimes, find_phases, quiet_end, read_signals
from daq_app.rocking.estimators import RestitutionEstimate, eav_series, estimate_all
from daq_app.rocking.geometry.joint import JointMotion
from daq_app.rocking.motion.filtered_peaks import corrected_peaks, filtered_peaks
from daq_app.rocking.motion.motion_fit import MotionFit, fit_motion
from daq_app.rocking.motion.swings import MotionSettings, MotionTrack
from daq_app.rocking.motion.transients import Onset, find_onsets
from daq_app.rocking.motion.velocity import VelocityFilter
from daq_app.rocking.record import TestRecord
from daq_app.rocking.theory import classic as theory
from daq_app.rocking.theory.block import RigidBlock

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class AnalysisOptions:
    """What may be chosen."""

    velocity_cutoff_hz: float | None = None
    """Cut-off of the stated filter; the rig's if None."""
    zero_at_rest: bool | None = None
    """Take the zero of every sensor from the rest after the test. None: where the record has no tare."""
    fit: bool = True
    """Fit the whole motion."""
    bias_runs: int = 6
    """Simulated tests behind the methods' bias; 0 leaves it out."""
    seed: int | None = None
    """Of the noise in the simulated tests. None: the record's label decides, so that the corrections of a
    campaign's tests share no error, and one record has one bias however it is analysed."""
    keep_series: bool = True


def analyse_record(record: TestRecord, options: AnalysisOptions | None = None) -> TestAnalysis:
    """Analyse one test. `ValueError` in words where the record cannot give rotation at all.

    A record without a release or impact gives `found = False` and a note, never an exception.
    """
    options = options or AnalysisOptions()
    cutoff = options.velocity_cutoff_hz or record.rig.acquisition.velocity_cutoff_hz
    velocity_filter = VelocityFilter(record.rate_hz, cutoff)
    from_rest = not record.tared if options.zero_at_rest is None else options.zero_at_rest
    signals, times = _zeroed_at_rest(record) if from_rest else _as_recorded(record)
    velocity = velocity_filter.velocity(signals.bridged_rad)
    if times.release_s is None or not times.impacts_s:
        return _nothing_found(record, signals, times, velocity, velocity_filter, options)
    return _analyse(record, signals, times, velocity, velocity_filter, options)


def _as_recorded(record: TestRecord) -> tuple[Signals, TestTimes]:
    signals = read_signals(record)
    return signals, find_phases(signals)


def _zeroed_at_rest(record: TestRecord) -> tuple[Signals, TestTimes]:
    """With every sensor's zero from the rest after the test; as recorded where no rest shows a test.

    Offsets of a run without a tare may be so large that no hold is recognised, so the end of the record
    serves as the first guess of the rest.
    """
    signals = read_signals(record)
    end = quiet_end(signals)
    times = find_phases(signals if end is None else signals.zeroed(end))
    if times.rest is None:
        times = find_phases(signals)
    if times.rest is None:
        return signals, times
    signals = signals.zeroed(times.rest)
    return signals, find_phases(signals)


def _analyse(
    record: TestRecord,
    signals: Signals,
    times: TestTimes,
    velocity: Floats,
    velocity_filter: VelocityFilter,
    options: AnalysisOptions,
) -> TestAnalysis:
    track = track_motion(signals.settings, times, signals.time_s, signals.rotation_rad)
    side = 1 if track.theta0_rad > 0 else -1
    peaks = filtered_peaks(signals.time_s, velocity, track.impacts_s)
    estimates = _estimates(signals, times, track, peaks, velocity_filter)
    onsets = _onsets(record, signals, track)
    fit = _fit(signals, track, estimates) if options.fit else None
    theta0 = _theta0(signals, track)
    headline = theta0.get("tiltmeters", theta0["wires"])
    bias: Mapping[str, Bias] = {}
    if options.bias_runs > 0:
        bias = method_bias(
            BiasSettings(
                settings=signals.settings,
                velocity_filter=velocity_filter,
                theta0_rad=track.theta0_rad,
                sigma_theta0_rad=track.sigma_theta0_rad,
                r=_typical_r(estimates),
                impacts=len(times.impacts_s),
                noise_rad=signals.noise_rad,
                with_fit=options.fit,
                runs=options.bias_runs,
                seed=zlib.crc32(record.label.encode()) if options.seed is None else options.seed,
            )
        )
    joint = summarise_joint(record, signals, track) if signals.joint is not None else None
    residuals = residuals_after(signals, times.rest)
    analysis = TestAnalysis(
        label=record.label,
        found=True,
        rate_hz=record.rate_hz,
        theta0_rad=headline.value,
        theta0_over_alpha=abs(headline.value) / signals.settings.alpha_rad,
        theta0_by_family=theta0,
        side=side,
        release_s=track.release.time_s,
        rest_s=math.nan if times.rest_s is None else times.rest_s,
        half_cycles=_half_cycles(signals.settings, track, peaks, onsets),
        estimates=estimates,
        fit=fit,
        bias=bias,
        theory=_theory(record, abs(headline.value), estimates["crt"].r, len(times.impacts_s)),
        joint=joint,
        residuals=residuals,
        noise_rad=signals.noise_rad,
        zero=signals.zero,
        filter_statement=velocity_filter.statement,
        notes=(),
        series=_series(signals, velocity) if options.keep_series else None,
    )
    return replace(analysis, notes=quality_notes(record, signals, times, track, analysis, onsets))


def track_motion(
    settings: MotionSettings, times: TestTimes, time_s: Floats, rotation_rad: Floats
) -> MotionTrack:
    """Half-cycles of a whole record, one after the other as online."""
    assert times.release_s is not None
    first, last = np.searchsorted(time_s, [times.release_s - 1.0, times.impacts_s[0] + 1e-3])
    track = MotionTrack.begin(
        settings, time_s[first:last], rotation_rad[first:last], times.release_s, times.hold_rad
    )
    track.add_impacts(times.impacts_s, time_s, rotation_rad)
    return track


def _onsets(record: TestRecord, signals: Signals, track: MotionTrack) -> list[Onset | None]:
    """The shocks that the accelerometers show; they are read about the impacts only."""
    ids = record.family("accelerometer")

    def read(start: int, stop: int) -> Floats:
        return record.load(ids, start, stop)

    offsets = [record.offset_s(channel_id) for channel_id in ids]
    return find_onsets(read, record.n_samples, record.rate_hz, signals.first_s, offsets, track.impacts_s)


def _estimates(
    signals: Signals, times: TestTimes, track: MotionTrack, peaks: Floats, velocity_filter: VelocityFilter
) -> dict[str, RestitutionEstimate]:
    """Every method; the keys are those of `TestAnalysis.estimates`."""
    p, alpha = signals.settings.p_rad_s, signals.settings.alpha_rad
    noise = np.full(peaks.size, velocity_filter.noise_rad_s(signals.noise_rad))
    corrected = corrected_peaks(peaks, velocity_filter, p, alpha)
    series = {
        "eav": track.eav_series(),
        "crt": track.crt_series(),
        "crt_exact": track.crt_exact_series(),
        "eav_filtered": eav_series(peaks, noise, method="EAV, filtered peaks (biased low)"),
        "eav_filtered_corrected": eav_series(
            corrected, noise, method="EAV, filtered peaks, amplitude loss corrected"
        ),
    }
    if signals.fused is not None and signals.joint is not None:
        others = {"best": signals.fused.rotation_rad, "lvdts": signals.joint.rotation_rad}
        for name, rotation in others.items():
            if np.isfinite(rotation).mean() > 0.9:
                other = track_motion(signals.settings, times, signals.time_s, rotation)
                series[f"eav_{name}"] = other.eav_series(f"EAV, rotation from {name}")
                series[f"crt_{name}"] = other.crt_series(f"CRT, rotation from {name}")
    return dict(zip(series, estimate_all(list(series.values())), strict=True))


def _typical_r(estimates: Mapping[str, RestitutionEstimate]) -> float:
    values = [e.r for e in (estimates["eav"], estimates["crt"]) if e.r is not None]
    return min(float(np.mean(values)), 0.999) if values else 0.9


def _fit(
    signals: Signals, track: MotionTrack, estimates: Mapping[str, RestitutionEstimate]
) -> MotionFit | None:
    return fit_motion(
        signals.time_s,
        signals.rotation_rad,
        release_s=track.release.time_s,
        theta0_rad=track.theta0_rad,
        impacts_s=track.impacts_s,
        peaks_rad=track.peaks_rad,
        speeds_rad_s=track.speeds_before_rad_s,
        r=_typical_r(estimates),
        scatter=max(estimates["eav"].scatter, estimates["crt"].scatter),
        noise_rad=signals.noise_rad,
        p_rad_s=signals.settings.p_rad_s,
        alpha_rad=signals.settings.alpha_rad,
    )


def _theta0(signals: Signals, track: MotionTrack) -> dict[str, ValueWithSigma]:
    """θ0 by family over the last half second of the hold (slow tiltmeters have settled), and the best."""
    start, stop = np.searchsorted(signals.time_s, [track.release.time_s - 0.5, track.release.time_s - 0.02])
    scale = abs(track.theta0_rad)
    found: dict[str, ValueWithSigma] = {}
    if signals.tilts_rad.shape[0]:
        value = signals.geometry.tilt(signals.tilts_rad[:, start:stop], track.theta0_rad)
        noise = signals.geometry.tilt_noise_rad / math.sqrt(
            max(signals.tilts_rad.shape[0] * (stop - start), 1)
        )
        spread = level(np.full(10, value), scale, noise)
        if math.isfinite(value):
            found["tiltmeters"] = spread
    found["wires"] = level(np.array([track.theta0_rad] * 10), scale, track.sigma_theta0_rad)
    if signals.joint is not None:
        lvdts = level(signals.joint.rotation_rad[start:stop], scale, signals.lvdt_noise_rad)
        if math.isfinite(lvdts.value):
            found["lvdts"] = lvdts
    found["best"] = best_value(found)
    return found


def _half_cycles(
    settings: MotionSettings, track: MotionTrack, peaks: Floats, onsets: list[Onset | None]
) -> tuple[HalfCycle, ...]:
    impacts = track.impacts_s
    starts = [track.release.time_s, *impacts]
    before, after = [math.nan, *track.speeds_before_rad_s], [math.nan, *track.speeds_after_rad_s]
    sigma_before = [math.nan, *track.sigma_speeds_before_rad_s]
    sigma_after = [math.nan, *track.sigma_speeds_after_rad_s]
    filtered = [math.nan, *peaks.tolist()]
    heard = [None, *onsets]
    peak, sigma = [*track.peaks_rad, math.nan], [*track.sigma_peaks_rad, math.nan]
    cycles = []
    for n, start in enumerate(starts):
        phi = abs(peak[n]) / settings.alpha_rad
        theoretical = float(theory.period(phi, settings.p_rad_s)) if 0.0 <= phi < 1.0 else math.nan
        shock = heard[n]
        cycles.append(
            HalfCycle(
                n=n,
                start_s=start,
                duration_s=starts[n + 1] - start if n + 1 < len(starts) else math.nan,
                peak_rad=peak[n],
                sigma_peak_rad=sigma[n],
                phi=phi,
                speed_before_rad_s=before[n],
                sigma_speed_before_rad_s=sigma_before[n],
                speed_after_rad_s=after[n],
                sigma_speed_after_rad_s=sigma_after[n],
                speed_filtered_rad_s=filtered[n],
                jump_ratio=abs(after[n] / before[n]) if before[n] else math.nan,
                accelerometer_s=math.nan if shock is None else shock.time_s,
                period_theory_s=theoretical / (4.0 if n == 0 else 2.0),
            )
        )
    return tuple(cycles)


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
    signals: Signals,
    times: TestTimes,
    velocity: Floats,
    velocity_filter: VelocityFilter,
    options: AnalysisOptions,
) -> TestAnalysis:
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
        estimates={},
        fit=None,
        bias={},
        theory=_theory(record, math.nan, None, 0),
        joint=None,
        residuals=None,
        noise_rad=signals.noise_rad,
        zero=signals.zero,
        filter_statement=velocity_filter.statement,
        notes=quality_notes(record, signals, times, None, None, []),
        series=_series(signals, velocity) if options.keep_series else None,
    )

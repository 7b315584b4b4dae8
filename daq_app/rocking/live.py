"""Rotation, velocity, phases and r while the test runs: one call per block, any block size."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Rig
from daq_app.config.scaling import Scaling
from daq_app.rocking.estimators import RestitutionEstimate, estimate_all
from daq_app.rocking.families.channels.noise import slow_noise
from daq_app.rocking.geometry.kinematics import RotationGeometry
from daq_app.rocking.live_families import LiveFamilies
from daq_app.rocking.motion.phases import Phase, PhaseDetector, PhaseEvent, PhaseSettings
from daq_app.rocking.motion.rolling import RollingArray
from daq_app.rocking.motion.swings import MotionSettings, MotionTrack
from daq_app.rocking.motion.velocity import VelocityFilter, VelocityStream
from daq_app.rocking.theory import classic as theory

Floats = NDArray[np.float64]

_MEMORY_S = 15.0
"""How far back rotation and tilt are kept: hold, fall and the longest half-cycle need less."""
_PIECE_FRAMES = 100
_TILT_WINDOW_S = (0.5, 0.02)
"""θ0 is read from the tiltmeters over this span before the release."""
_STILL_S = (1.0, 0.02)
"""Slow noise is looked for over this span before the release."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """r so far. Same fields as the `estimate` message of the acquisition process."""

    theta0_rad: float
    """From the tiltmeters; from the wires where there is no tiltmeter."""
    release_sample: int
    impact_samples: list[float]
    peaks_rad: list[float]
    impact_velocities_rad_s: list[float]
    """θ̇⁻, just before each impact, by one-sided fits."""
    eav: RestitutionEstimate
    crt: RestitutionEstimate
    r_max: float
    """1 − 3/2 sin²α (1.2)."""
    doubts: tuple[str, ...] = ()
    """Sentences: which family, or which method, disagrees with this r."""

    def as_message(self) -> dict[str, object]:
        """Plain values for an `EstimateMessage`; half-cycles that could not be fitted are NaN."""
        return {
            "theta0_rad": self.theta0_rad,
            "release_sample": self.release_sample,
            "impact_samples": self.impact_samples,
            "peaks_rad": self.peaks_rad,
            "impact_velocities_rad_s": self.impact_velocities_rad_s,
            "eav": [{"impact": point.impact, "r": point.r} for point in self.eav.points],
            "crt": [{"impact": point.impact, "r": point.r} for point in self.crt.points],
            "eav_mean": self.eav.r,
            "eav_standard_error": self.eav.standard_error,
            "crt_mean": self.crt.r,
            "crt_standard_error": self.crt.standard_error,
            "r_max": self.r_max,
            "doubts": self.doubts,
        }


@dataclass(frozen=True, slots=True)
class LiveResult:
    """What one block made known."""

    first_sample: int
    """Sample of the first rotation and velocity: they trail the block by the filter's delay."""
    rotation_rad: Floats
    velocity_rad_s: Floats
    """Same samples as `rotation_rad`."""
    tilt_rad: float
    """Mean of the tiltmeters over the block; NaN without tiltmeters."""
    phase: Phase
    events: tuple[PhaseEvent, ...] = ()
    estimate: Estimate | None = None
    """The whole estimate, in blocks where it changed."""
    excluded_wires: tuple[str, ...] = ()
    """Wires that disagreed with the others anywhere in the block."""

    @property
    def impacts(self) -> tuple[float, ...]:
        """Fractional samples of the impacts detected in this block."""
        return tuple(event.sample for event in self.events if event.kind == "impact")


class LiveAnalyser:
    """Online analysis of one test. Use a new one for each test.

    `tare` is what zeroing found beyond each channel's offset, unit of the reading, by id. `tell` is called
    with each estimate before the other families are asked about it: that takes up to five times as long as
    r, and somebody waits for r. It has the doubts that were there before.
    """

    def __init__(
        self,
        rig: Rig,
        rate_hz: float,
        tare: Mapping[str, float],
        tell: Callable[[Estimate], None] | None = None,
    ) -> None:
        if not rate_hz > 0:
            raise ValueError(f"the sampling rate must be positive, not {rate_hz:g} Hz")
        self._rig, self._rate, self._tell = rig, rate_hz, tell
        settings = PhaseSettings.from_rig(rig, rate_hz, 0.0)
        self._frame = settings.frame_samples
        self.geometry = RotationGeometry.from_rig(rig, frame_samples=self._frame)
        settings = PhaseSettings.from_rig(rig, rate_hz, self.geometry.rotation_noise_rad())
        if not tare:
            # Without a zero wires and tiltmeters have offsets of their own: a hold is one all the same.
            settings = replace(settings, level_rad=settings.smallest_hold * settings.alpha_rad)
        self.velocity_filter = VelocityFilter(rate_hz, rig.acquisition.velocity_cutoff_hz)
        index = {channel_id: row for row, channel_id in enumerate(rig.channel_ids)}
        self._families = LiveFamilies(rig, rate_hz)
        used = [*self.geometry.wires.ids, *self.geometry.tilt_ids, *self._families.ids]
        self._rows = np.array([index[channel_id] for channel_id in used])
        self._scaling = Scaling.of([rig.channel(channel_id) for channel_id in used], tare)
        self._n_wires = len(self.geometry.wires.ids)
        self._tilts = slice(self._n_wires, self._n_wires + len(self.geometry.tilt_ids))
        self._phase_settings = settings
        self._motion_settings = MotionSettings(rate_hz, settings.p_rad_s, settings.alpha_rad)
        self._settings_of_test = self._motion_settings
        self._watch = self.geometry.watch()
        self._stream = VelocityStream(self.velocity_filter)
        self._log = RollingArray(round(_MEMORY_S * rate_hz), 1 + len(self.geometry.tilt_ids))
        self._pending = np.empty((len(used), 0))
        self._detector: PhaseDetector | None = None
        self._first = self._next = self._shown = 0
        self._last_rotation = 0.0
        self._trailing = np.empty(0)
        self._release: PhaseEvent | None = None
        self._track: MotionTrack | None = None
        self._theta0_tilt = math.nan

    @property
    def phase(self) -> Phase:
        return Phase.WAITING if self._detector is None else self._detector.phase

    def process(self, first_sample: int, readings: Floats) -> LiveResult:
        """Continue with a block of readings (all channels in rig order, n), unit of the reading.

        A gap since the last block is bridged with the last rotation for the detector and left out
        of all fits. `ValueError` for a block that overlaps the last, or of another number of rows.
        """
        if readings.ndim != 2 or readings.shape[0] != len(self._rig.channels):
            raise ValueError(
                f"a block has one row per channel of the rig, {len(self._rig.channels)}, not {readings.shape}"
            )
        if self._detector is None:
            self._detector = PhaseDetector(self._phase_settings, first_sample)
            self._first = self._next = self._shown = first_sample
        missing = first_sample - self._next
        if missing < 0:
            raise ValueError(f"sample {first_sample} was already analysed: the next is {self._next}")
        self._next = first_sample + readings.shape[1]
        si = readings[self._rows]
        si = self._scaling.to_si(si, out=si)
        tilt = self.geometry.tilt(si[self._tilts], self._last_rotation)
        if missing or self._pending.shape[1]:
            si = np.concatenate((self._pending, np.full((si.shape[0], missing), np.nan), si), axis=1)
        whole = si.shape[1] // self._frame * self._frame
        self._pending = si[:, whole:]
        return self._analyse(si[:, :whole], tilt)

    def _analyse(self, si: Floats, tilt_rad: float) -> LiveResult:
        """Whole frames of SI values of all channels that are used."""
        assert self._detector is not None
        first = self._shown
        rotations, velocities = [self._trailing], []
        events: list[PhaseEvent] = []
        excluded = np.zeros(self._n_wires, dtype=bool)
        estimate: Estimate | None = None
        # Pieces of bounded length: a whole record may come as one block, the memory is finite.
        for start in range(0, si.shape[1], _PIECE_FRAMES * self._frame):
            piece = si[:, start : start + _PIECE_FRAMES * self._frame]
            wires = self.geometry.rotation(piece[: self._n_wires], self._watch)
            if wires.excluded.any():
                # In a gap no wire has a value: none disagrees with the others.
                excluded |= (wires.excluded & ~wires.excluded.all(axis=0)).any(axis=1)
            self._log.append(wires.rotation_rad[None], piece[self._tilts])
            of_wires, of_families = piece[: self._n_wires], piece[self._tilts.stop :]
            self._families.append(self._first, wires.rotation_rad, of_wires, of_families)
            bridged = _bridge(wires.rotation_rad, self._last_rotation)
            self._last_rotation = float(bridged[-1])
            rotations.append(bridged)
            velocities.append(self._stream.process(bridged))
            for event in self._detector.process(bridged, piece[self._tilts]):
                events.append(event)
                estimate = self._follow(event) or estimate
        velocity = np.concatenate(velocities) if velocities else np.empty(0)
        rotation = np.concatenate(rotations)
        self._trailing = rotation[velocity.size :]
        self._shown += velocity.size
        return LiveResult(
            first_sample=first,
            rotation_rad=rotation[: velocity.size],
            velocity_rad_s=velocity,
            tilt_rad=tilt_rad,
            phase=self._detector.phase,
            events=tuple(events),
            estimate=estimate,
            excluded_wires=tuple(np.array(self.geometry.wires.ids)[excluded].tolist())
            if excluded.any()
            else (),
        )

    # -- the motion ------------------------------------------------------------------------------

    def _follow(self, event: PhaseEvent) -> Estimate | None:
        """Take in an event; the estimate where it changed."""
        if event.kind == "release":
            self._release, self._track = event, None
            self._theta0_tilt = self._tilt_before(event.sample)
            self._settings_of_test = self._with_slow_noise(event.sample)
            self._families.forget()
        elif event.kind == "caught":
            self._release = self._track = None
            return None
        elif event.kind == "impact" and self._release is not None:
            time, rotation = self._since(event.sample)
            if self._track is None:
                self._track = MotionTrack.begin(
                    self._settings_of_test,
                    time,
                    rotation,
                    self._release.sample / self._rate,
                    self._detector.theta0_rad if self._detector else math.nan,
                )
            self._track.add_impact(event.sample / self._rate, time, rotation)
            estimate = self._estimate()
            if self._tell is not None:
                self._tell(estimate)
            self._families.look(self._track, self._theta0_tilt, estimate.eav, estimate.crt)
            return replace(estimate, doubts=self._families.doubts)
        else:
            return None
        return self._estimate()

    def _since(self, stop_sample: float) -> tuple[Floats, Floats]:
        """Time and rotation from before the release, or the last impact, up to a sample."""
        assert self._release is not None
        crossings = self._track.crossings_s if self._track else []
        start_s = crossings[-1] if crossings else self._release.sample / self._rate - 1.0
        start = max(math.floor(start_s * self._rate) - self._first, self._log.start)
        stop = min(math.ceil(stop_sample) - self._first + 1, self._log.end)
        time = (self._first + np.arange(start, stop)) / self._rate
        return time, self._log.slice(start, stop)[0]

    def _with_slow_noise(self, release_sample: float) -> MotionSettings:
        """Half-cycles judged by what long means of the hold scatter by, as after the test."""
        start, stop = (round(release_sample - span * self._rate) - self._first for span in _STILL_S)
        noise = slow_noise(self._log.slice(start, stop)[0], self._rate)
        if not math.isfinite(noise):
            return self._motion_settings
        return replace(self._motion_settings, slow_noise_rad=max(noise, self.geometry.rotation_noise_rad()))

    def _tilt_before(self, release_sample: float) -> float:
        start, stop = (round(release_sample - span * self._rate) - self._first for span in _TILT_WINDOW_S)
        tilts = self._log.slice(start, stop)[1:]
        reference = self._detector.theta0_rad if self._detector else math.nan
        return self.geometry.tilt(tilts, reference) if tilts.size else math.nan

    def _estimate(self) -> Estimate:
        assert self._release is not None and self._detector is not None
        track = self._track
        level = self._detector.theta0_rad if track is None else track.theta0_rad
        theta0 = self._theta0_tilt if math.isfinite(self._theta0_tilt) else level
        release = self._release.sample if track is None else track.release.time_s * self._rate
        alpha = self._motion_settings.alpha_rad
        eav, crt = RestitutionEstimate("EAV", ()), RestitutionEstimate("CRT", ())
        if track is not None:
            eav, crt = estimate_all([track.eav_series(), track.crt_series()])
        return Estimate(
            theta0_rad=theta0,
            release_sample=round(release),
            impact_samples=[] if track is None else [t * self._rate for t in track.impacts_s],
            peaks_rad=[level] if track is None else track.peaks_rad,
            impact_velocities_rad_s=[] if track is None else track.speeds_before_rad_s,
            eav=eav,
            crt=crt,
            r_max=float(theory.r_max_rectangular(alpha)),
            doubts=self._families.doubts,
        )


def _bridge(rotation_rad: Floats, last_rad: float) -> Floats:
    """Missing values replaced by the last good one, for what needs an unbroken signal."""
    bad = ~np.isfinite(rotation_rad)
    if not bad.any():
        return rotation_rad
    index = np.where(bad, -1, np.arange(rotation_rad.size))
    index = np.maximum.accumulate(index)
    return np.where(index < 0, last_rad, rotation_rad[np.maximum(index, 0)])

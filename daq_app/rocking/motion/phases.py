"""What the wall is doing, found causally: held, released, rocking (each impact), at rest.

The detector works on means of 5 ms ("frames"), always cut at the same samples, so that the answer
does not depend on the size of the blocks it is fed. It believes a release only when the rotation
leaves a steady hold *and* gains speed as a free fall from there must (or passes through zero with
the speed of one): pulling, lowering by hand, bumps, footsteps and jerks of the cable do neither.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Rig
from daq_app.config.wording import true_minus
from daq_app.rocking.means import mean_of, row_means
from daq_app.rocking.motion.release import locate_release
from daq_app.rocking.motion.rolling import RollingArray
from daq_app.rocking.theory.housner import exact_amplitude

Floats = NDArray[np.float64]


class Phase(StrEnum):
    """Where a test stands."""

    WAITING = "waiting"
    HOLDING = "holding"
    FALLING = "falling"
    ROCKING = "rocking"
    AT_REST = "at_rest"


@dataclass(frozen=True, slots=True)
class PhaseEvent:
    """Something that happened. `kind`: hold, hold_lost, release, caught, impact or rest."""

    kind: str
    sample: float
    """When it happened: absolute, fractional sample index."""
    detected_sample: int
    """When the detector knew: the sample after the frame that decided."""
    rotation_rad: float
    text: str


@dataclass(frozen=True, slots=True)
class PhaseSettings:
    """Thresholds; the defaults suit walls of several tonnes."""

    rate_hz: float
    p_rad_s: float
    alpha_rad: float
    noise_rad: float
    """Expected rms of the rotation, one sample."""
    frame_s: float = 0.005
    window_s: float = 1.0
    """How long the wall must be steady to be held, and quiet to be at rest."""
    smallest_hold: float = 0.06
    """Smallest |θ|/α that counts as pulled."""
    steady_rad: float = 1.5e-3
    """Range of 50 ms means within the window of a steady hold."""
    level_rad: float = 3e-3
    """How far a tiltmeter may differ from the rotation of a hold that it confirms."""
    quiet_rad: float = 4e-4
    """Range of the frames within the window of a wall at rest."""
    quiet_rad_s: float = 0.03
    """Largest speed over 20 ms within that window."""
    crossing_rad: float = 1.2e-4
    """An impact is believed once the rotation has gone this far beyond zero."""

    @classmethod
    def from_rig(cls, rig: Rig, rate_hz: float, noise_rad: float) -> PhaseSettings:
        return cls(rate_hz, rig.specimen.p_rad_s, rig.specimen.alpha0_rad, noise_rad)

    @property
    def frame_samples(self) -> int:
        return max(1, round(self.rate_hz * self.frame_s))

    @property
    def frame_noise_rad(self) -> float:
        return self.noise_rad / math.sqrt(self.frame_samples)


_TICK = 10
"""Frames between two looks at the slow conditions (hold, rest)."""
_SLOPE = 6
"""Frames over which the speed is read."""


class PhaseDetector:
    """Feed it rotation and tilt in blocks of any size; it answers with events."""

    def __init__(self, settings: PhaseSettings, first_sample: int = 0) -> None:
        self.settings = settings
        self.phase = Phase.WAITING
        self.side = 0
        """Sign of the hold; 0 before the first."""
        self._first = first_sample
        self._hold_rad = math.nan
        self._crossing_side = 0
        self._fast_frames = 0
        self._lost_ticks = 0
        self._noise = settings.frame_noise_rad
        self._events: list[PhaseEvent] = []
        self._window = round(settings.window_s / settings.frame_s)
        self._frames = RollingArray(40 * self._window)
        self._raw = RollingArray(2 * self._window * settings.frame_samples)
        self._tilts: RollingArray | None = None
        self._pending = np.empty((1, 0))

    @property
    def theta0_rad(self) -> float:
        """Rotation of the last steady hold, from the rotation signal; NaN before the first."""
        return self._hold_rad

    def process(self, rotation_rad: Floats, tilts_rad: Floats) -> list[PhaseEvent]:
        """Continue with rotation (n,) and tiltmeters (k, n), k may be 0; the events that are new."""
        joined = np.concatenate((rotation_rad[None], tilts_rad))
        if self._pending.shape[1]:
            joined = np.concatenate((self._pending, joined), axis=1)
        size = self.settings.frame_samples
        count = joined.shape[1] // size
        whole = joined[:, : count * size].reshape(joined.shape[0], count, size)
        means = row_means(whole)
        self._pending = joined[:, count * size :]
        if self._tilts is None:
            self._tilts = RollingArray(2 * self._window, max(joined.shape[0] - 1, 1))
        self._events = []
        index = 0
        while index < count:
            # A stretch in which nothing can happen goes in as one piece, with the frame behind it.
            stop = min(index + self._uneventful(means[0, index:]) + 1, count)
            self._raw.append(whole[0, index:stop].reshape(1, -1))
            self._frames.append(means[:1, index:stop])
            if joined.shape[0] > 1:
                self._tilts.append(means[1:, index:stop])
            self._step()
            index = stop
        return self._events

    def _uneventful(self, frames: Floats) -> int:
        """How many of the next frames `_step` would pass by: before the next tick, and none of them tells."""
        ahead = frames[: -(self._frames.end + 1) % _TICK]
        if not ahead.size or self.phase is Phase.AT_REST or (self.phase is Phase.WAITING and not self.side):
            return ahead.size
        beyond = max(self.settings.crossing_rad, 6.0 * self._noise)
        still = self._crossing_side * ahead > -beyond
        if self.phase is Phase.HOLDING:
            still &= self.side * ahead > 0.8 * abs(self._hold_rad)
            if still[0]:
                self._fast_frames = 0
        return int(ahead.size if still.all() else np.argmin(still))

    # -- one frame -------------------------------------------------------------------------------

    def _step(self) -> None:
        now = self._frames.end
        tick = now % _TICK == 0 and now >= self._window
        match self.phase:
            case Phase.WAITING:
                self._step_waiting(tick)
            case Phase.HOLDING:
                self._step_holding(tick)
            case Phase.FALLING:
                self._step_falling(tick)
            case Phase.ROCKING:
                self._check_crossing(released=True)
                if tick:
                    self._check_rest()

    def _step_waiting(self, tick: bool) -> None:
        if tick and (level := self._steady_level()) is not None:
            self._enter_hold(level)
        elif self.side:
            self._check_crossing(released=False)

    def _step_holding(self, tick: bool) -> None:
        if tick:
            self._follow_hold()
        self._check_fall()
        if self.phase is Phase.HOLDING:
            self._check_crossing(released=False)

    def _step_falling(self, tick: bool) -> None:
        self._check_crossing(released=True)
        if tick and self.phase is Phase.FALLING and self._caught():
            self.phase = Phase.WAITING
            sample = float(self._sample(self._frames.end))
            self._say("caught", sample, "the wall was caught before it reached upright")

    def _sample(self, frame: float) -> float:
        """Absolute sample at the start of an absolute frame."""
        return self._first + frame * self.settings.frame_samples

    def _sample_of(self, frames: Floats) -> Floats:
        return np.asarray(
            self._first + (frames - 0.5 / self.settings.frame_samples) * self.settings.frame_samples
        )

    def _say(self, kind: str, sample: float, text: str) -> None:
        detected = int(self._sample(self._frames.end))
        rotation = float(self._frames.last(1)[0, 0])
        self._events.append(PhaseEvent(kind, sample, detected, rotation, true_minus(text)))

    # -- hold ------------------------------------------------------------------------------------

    def _steady_level(self) -> float | None:
        """Mean of the last window where the wall is held steady through it; None where it is not."""
        frames = self._frames.last(self._window)[0]
        level = mean_of(frames)
        if not abs(level) >= self.settings.smallest_hold * self.settings.alpha_rad:
            return None
        ticks = row_means(frames.reshape(-1, _TICK))
        if not ticks.max() - ticks.min() < self.settings.steady_rad or not self._tilts_agree(level):
            return None
        return level

    def _tilts_agree(self, level: float) -> bool:
        """Whether some tiltmeter shows the same steady rotation; True where there is none to ask."""
        assert self._tilts is not None
        tilts = self._tilts.last(self._window)
        if not tilts.size or not np.isfinite(tilts).all(axis=1).any():
            return True
        first, last = row_means(tilts[:, : 2 * _TICK]), row_means(tilts[:, -2 * _TICK :])
        near = np.abs(last - level) < max(self.settings.level_rad, 0.08 * abs(level))
        still = np.abs(last - first) < self.settings.steady_rad
        return bool(np.any(near & still))

    def _remember_hold(self, level: float) -> None:
        self._hold_rad = level
        differences = np.diff(self._frames.last(self._window)[0])
        scattered = differences - mean_of(differences)
        noise = math.sqrt(mean_of(scattered * scattered) / 2.0)
        self._noise = max(self.settings.frame_noise_rad, noise)

    def _enter_hold(self, level: float) -> None:
        self._remember_hold(level)
        self.phase, self._lost_ticks, self._fast_frames = Phase.HOLDING, 0, 0
        self.side = self._crossing_side = 1 if self._hold_rad > 0 else -1
        share = abs(self._hold_rad) / self.settings.alpha_rad
        start = self._sample(self._frames.end - self._window)
        self._say("hold", start, f"held steady at {self._hold_rad * 1e3:.1f} mrad (θ/α = {share:.3f})")

    def _follow_hold(self) -> None:
        if (level := self._steady_level()) is not None:
            self._remember_hold(level)
            self._lost_ticks = 0
            return
        recent = mean_of(self._frames.last(_TICK)[0])
        away = abs(recent - self._hold_rad) > max(4 * self.settings.steady_rad, 0.15 * abs(self._hold_rad))
        self._lost_ticks = self._lost_ticks + 1 if away else 0
        if self._lost_ticks * _TICK >= 2 * self._window:
            self.phase = Phase.WAITING
            self._say("hold_lost", self._sample(self._frames.end), "the wall is no longer held where it was")

    # -- release ---------------------------------------------------------------------------------

    def _speed(self) -> tuple[float, float]:
        """Rotation and speed at the middle of the last frames."""
        frames = self._frames.last(_SLOPE)[0]
        steps = np.arange(frames.size) - (frames.size - 1) / 2.0
        slope = float(steps @ frames) / float(steps @ steps)
        return mean_of(frames), slope / self.settings.frame_s

    def _free_speed_square(self, from_rad: float, at_rad: float) -> float:
        alpha, p = self.settings.alpha_rad, self.settings.p_rad_s
        return 2.0 * p * p * (math.cos(alpha - from_rad) - math.cos(alpha - at_rad))

    def _check_fall(self) -> None:
        level = abs(self._hold_rad)
        if self.side * float(self._frames.last(1)[0, 0]) > 0.8 * level:
            self._fast_frames = 0
            return
        rotation, speed = self._speed()
        here, inwards = self.side * rotation, -self.side * speed
        free = self._free_speed_square(level, here) if here < level else math.inf
        falls = inwards > 0.0 and 0.5 < inwards * inwards / free < 1.6
        self._fast_frames = self._fast_frames + 1 if falls else 0
        if self._fast_frames >= 4 and here < 0.7 * level:
            self._release()

    def _release(self) -> None:
        """Go over to the fall, and say when it began."""
        count = min(self._frames.end - self._frames.start, 2 * self._window)
        frames = self._frames.last(count)[0]
        held = np.flatnonzero(self.side * frames > 0.98 * abs(self._hold_rad))
        left = int(held[-1]) + 1 if held.size else 0
        crude = self._sample(self._frames.end - count + left)
        # Half a second of hold is enough, and leaves out the pulling of a short hold.
        skip = max(left - self._window // 2, 0)
        frames = frames[skip:]
        middle = self._frames.end - frames.size + np.arange(frames.size) + 0.5
        times = self._sample_of(middle) / self.settings.rate_hz
        inside = self.side * frames > 0.03 * abs(self._hold_rad)
        release = locate_release(
            times[inside], frames[inside], self._hold_rad, self.settings.p_rad_s, self.settings.alpha_rad
        )
        sample = crude if release is None else release.time_s * self.settings.rate_hz
        if not self._sample(self._frames.end - count) <= sample <= self._sample(self._frames.end):
            sample = crude
        self.phase = Phase.FALLING
        self._say("release", sample, f"released from {self._hold_rad * 1e3:.1f} mrad")

    def _caught(self) -> bool:
        frames = self._frames.last(max(self._window // 3, 2 * _TICK))[0]
        still = frames.max() - frames.min() < self.settings.steady_rad
        return bool(still) and abs(mean_of(frames)) > 0.1 * abs(self._hold_rad)

    # -- impacts ---------------------------------------------------------------------------------

    def _check_crossing(self, *, released: bool) -> None:
        beyond = max(self.settings.crossing_rad, 6.0 * self._noise)
        value = float(self._frames.last(1)[0, 0])
        if not released:
            # Before a release the side follows the rotation, with room for handling around upright.
            if self._crossing_side * value > -beyond:
                return
            freely = self._crossed_freely()
            self._crossing_side = -self._crossing_side
            if not freely:
                return
            self.side = -self._crossing_side
            self._release()
            self._crossing_side = self.side
        if self._crossing_side * value > -beyond:
            return
        sample = self._locate_crossing()
        self._crossing_side = -self._crossing_side
        self.phase = Phase.ROCKING
        self._say("impact", sample, "impact")

    def _crossed_freely(self) -> bool:
        """Whether the wall came through zero with the speed of a fall from about the hold."""
        if self._crossing_side != self.side:
            return False
        _, speed = self._speed()
        alpha, p = self.settings.alpha_rad, self.settings.p_rad_s
        ratio = speed * speed / (2.0 * p * p * (1.0 - math.cos(alpha)))
        if not 0.0 < ratio < 0.98 or speed * self.side > 0.0:
            return False
        fallen = float(exact_amplitude(ratio, alpha))
        peak = float(np.max(self.side * self._frames.last(2 * self._window)[0]))
        return 0.4 * abs(self._hold_rad) < fallen and 0.5 < fallen / peak < 1.5

    def _locate_crossing(self) -> float:
        """Zero crossing by a straight line through the samples around it."""
        frames = self._frames.last(2 * self._window)[0]
        before = np.flatnonzero(self._crossing_side * frames > 0.0)
        last = self._frames.end - frames.size + (int(before[-1]) if before.size else frames.size - 1)
        size = self.settings.frame_samples
        start, stop = (last - 1) * size, (last + 3) * size
        raw = self._raw.slice(start, stop)[0]
        start = max(start, self._raw.start)
        steps = np.arange(raw.size) - (raw.size - 1) / 2.0
        slope = float(steps @ raw) / float(steps @ steps)
        middle = start + (raw.size - 1) / 2.0
        crossing = middle - float(raw.mean()) / slope if slope else middle
        return self._first + float(np.clip(crossing, start, start + raw.size))

    # -- rest ------------------------------------------------------------------------------------

    def _check_rest(self) -> None:
        frames = self._frames.last(self._window)[0]
        band = max(self.settings.quiet_rad, 12.0 * self._noise)
        step = max(1, round(0.02 / self.settings.frame_s))
        fastest = float(np.abs(frames[step:] - frames[:-step]).max()) / (step * self.settings.frame_s)
        if not (frames.max() - frames.min() < band and fastest < self.settings.quiet_rad_s):
            return
        level = mean_of(frames)
        history = self._frames.last(10 * self._window)[0]
        loud = np.flatnonzero(np.abs(history - level) > band / 2.0)
        quiet = self._frames.end - history.size + (int(loud[-1]) + 1 if loud.size else 0)
        self.phase = Phase.AT_REST
        upright = abs(level) < 0.05 * self.settings.alpha_rad
        where = "" if upright else ", not upright: was the wall caught?"
        self._say("rest", self._sample(quiet), f"at rest at {round(level * 1e3, 2) + 0.0:.2f} mrad{where}")

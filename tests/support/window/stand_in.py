"""A stand-in for the acquisition: the messages of a whole simulated test, with a known motion.

Used where a test wants to know exactly what came over the wire; the tests of the whole window use
the real acquisition process.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from daq_app.acquisition.messages.published import (
    BlockMessage,
    EstimateMessage,
    EstimatePoint,
    HealthMessage,
    Judgement,
    MotionMessage,
    State,
    StateMessage,
)
from daq_app.config import Scaling
from daq_app.config.rig import Channel, Rig
from daq_app.rocking.theory import classic as theory
from daq_app.rocking.theory.housner import FreeRocking, free_rocking
from daq_app.runfile import JournalWriter, RunHeader, finalise


@dataclass(frozen=True)
class Instant:
    """What comes over the wire at one time since the start of the stand-in."""

    time_s: float
    messages: list[tuple[BaseModel, np.ndarray | None]]


def channel_signal(
    channel: Channel, rig: Rig, theta: np.ndarray, tilt: np.ndarray, hits: np.ndarray
) -> np.ndarray:
    """A plain idea of what a channel shows at rotation `theta`, SI."""
    x, _, z = channel.position_m
    half = rig.specimen.base_width_m / 2
    if channel.family == "lvdt":
        return np.where(theta > 0, half - x, -(half + x)) * np.sin(theta)
    if channel.family == "wire":
        return z * np.sin(theta)
    if channel.family == "tiltmeter":
        return tilt if channel.axis == "x" else 0.02 * tilt
    return hits * (1.0 if channel.axis == "x" else 2.0) * max(z, 0.3)


class StandIn:
    """One test: 4 s upright, 4 s pull, 4 s hold, release, rocking, rest."""

    upright_s, pull_s, hold_s, rest_s = 4.0, 4.0, 4.0, 1.5
    block = 400
    step = 10

    def __init__(self, rig: Rig, *, ratio: float = 0.35, restitution: float = 0.895, seed: int = 3) -> None:
        self.rig, self.rate_hz, self.seed = rig, 4000.0, seed
        specimen = rig.specimen
        self.theta0 = ratio * specimen.alpha0_rad
        self.release_s = self.upright_s + self.pull_s + self.hold_s
        self.motion: FreeRocking = free_rocking(
            self.theta0,
            restitution,
            specimen.p_rad_s,
            specimen.alpha0_rad,
            release_s=self.release_s,
            smallest_peak_rad=0.006 * specimen.alpha0_rad,
        )
        rng = np.random.default_rng(seed)
        levels = np.array([channel.noise_si for channel in rig.channels])[:, None]
        self._noise = levels * rng.normal(size=(levels.size, 20_011))
        """Noise of all channels; each block takes a piece of it."""
        self.end_s = float(self.motion.impacts_s[-1]) + self.rest_s

    def rotation(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rotation, velocity = self.motion.at(time_s)
        pulled = np.clip((time_s - self.upright_s) / self.pull_s, 0, 1)
        smooth = self.theta0 * pulled**2 * (3 - 2 * pulled)
        return np.where(time_s < self.release_s, smooth, rotation), velocity

    def estimate(self, time_s: float) -> EstimateMessage:
        rate, alpha = self.rate_hz, self.rig.specimen.alpha0_rad
        done = int(np.sum(self.motion.impacts_s <= time_s))
        signs = np.where(np.arange(self.motion.peaks_rad.size) % 2 == 0, 1.0, -1.0)
        peaks = self.motion.peaks_rad * signs
        speeds = self.motion.speeds_before_rad_s
        rng = np.random.default_rng(self.seed)
        wobble = 1 + 0.006 * rng.normal(size=(2, 60))
        eav = [
            EstimatePoint(impact=n + 3, r=float(np.sqrt(speeds[n + 2] / speeds[n]) * wobble[0, n]))
            for n in range(max(0, done - 2))
        ]
        crt = [
            EstimatePoint(
                impact=n,
                r=float(
                    theory.restitution_from_peaks(peaks[0] / alpha, abs(peaks[n]) / alpha, n) * wobble[1, n]
                ),
            )
            for n in range(1, done)
        ]

        def summary(points: list[EstimatePoint]) -> tuple[float | None, float | None]:
            values = [point.r for point in points]
            mean = float(np.mean(values)) if values else None
            error = float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else None
            return mean, error

        return EstimateMessage(
            theta0_rad=self.theta0,
            release_sample=round(self.release_s * rate),
            impact_samples=[float(t * rate) for t in self.motion.impacts_s[:done]],
            peaks_rad=[float(p) for p in peaks[: max(done, 1)]],
            impact_velocities_rad_s=[float(v) for v in speeds[:done]],
            eav=eav,
            crt=crt,
            eav_mean=summary(eav)[0],
            eav_standard_error=summary(eav)[1],
            crt_mean=summary(crt)[0],
            crt_standard_error=summary(crt)[1],
            r_max=0.931,
        )

    def state(self, time_s: float) -> State:
        if time_s < self.upright_s:
            return State.PREVIEWING
        if time_s < self.upright_s + self.pull_s + 0.5:
            return State.ARMED
        if time_s < self.release_s:
            return State.HOLDING
        if time_s < self.motion.impacts_s[0]:
            return State.RELEASED
        return State.ROCKING if time_s < self.motion.impacts_s[-1] + 0.5 else State.AT_REST

    def block_readings(self, first: int) -> np.ndarray:
        time = (first + np.arange(self.block)) / self.rate_hz
        theta, _ = self.rotation(time)
        hits = np.zeros(self.block)
        for impact, speed in zip(self.motion.impacts_s, self.motion.speeds_before_rad_s, strict=True):
            since = time - impact
            ring = (since >= 0) & (since < 0.2)
            hits[ring] += 60 * speed * np.exp(-since[ring] / 0.015) * np.cos(2 * np.pi * 90 * since[ring])
        rows = [channel_signal(channel, self.rig, theta, theta, hits) for channel in self.rig.channels]
        start = (first * 7919) % (self._noise.shape[1] - self.block)
        return (np.array(rows) + self._noise[:, start : start + self.block]).astype(np.float32)

    def instants(self, until_s: float | None = None) -> Iterator[Instant]:
        """All that is published, block by block."""
        shown: object = None
        impacts = -1
        n_blocks = int((until_s if until_s is not None else self.end_s) * self.rate_hz) // self.block
        for number in range(n_blocks):
            first = number * self.block
            end_s = (first + self.block) / self.rate_hz
            messages: list[tuple[BaseModel, np.ndarray | None]] = []
            state = self.state(end_s)
            if state is not shown or number % 10 == 0:
                shown = state
                messages.append(
                    (
                        StateMessage(
                            state=state,
                            judgement=Judgement(word=state.value.capitalize()),
                            test="FR1-L3-2",
                            sample=first + self.block,
                            since_sample=round(self.upright_s * self.rate_hz),
                        ),
                        None,
                    )
                )
            readings = self.block_readings(first)
            heading = BlockMessage(
                first_sample=first,
                n_samples=self.block,
                n_channels=len(self.rig.channels),
                rate_hz=self.rate_hz,
            )
            messages.append((heading, readings))
            time = (first + self.step * np.arange(self.block // self.step)) / self.rate_hz
            theta, omega = self.rotation(time)
            messages.append(
                (
                    MotionMessage(
                        first_sample=first,
                        step=self.step,
                        rate_hz=self.rate_hz,
                        rotation_rad=theta.tolist(),
                        velocity_rad_s=omega.tolist(),
                        judged_rad=float(theta[-1]),
                    ),
                    None,
                )
            )
            done = int(np.sum(self.motion.impacts_s <= end_s))
            if end_s > self.release_s and done != impacts:
                impacts = done
                messages.append((self.estimate(end_s), None))
            if number % 2 == 0:
                messages.append((self.health(end_s), None))
            yield Instant(end_s, messages)

    def health(self, time_s: float) -> HealthMessage:
        recording = time_s >= self.upright_s
        samples = round(time_s * self.rate_hz)
        safe = round((time_s - 0.1) * self.rate_hz)
        return HealthMessage(
            sample=samples,
            acknowledged_sample=max(0, safe) if recording else 0,
            recording=recording,
            backlog_samples=400,
            buffer_samples=80000,
            gaps=0,
            lost_samples=0,
            file_bytes=max(0, safe - round(self.upright_s * self.rate_hz)) * 41 * 8,
            free_bytes=84_000_000_000,
            block_to_disk_ms_p99=7.0,
        )


def write_run(
    stand_in: StandIn,
    rig_file: Path,
    folder: Path,
    test: str,
    when_s: int = 0,
    end_text: str = "at rest",
    notes: str = "",
) -> Path:
    """A finished run file of the stand-in's test; `end_text`: what its last event says."""
    rig = stand_in.rig
    header = RunHeader(
        run_id=f"{test}_{when_s}",
        test=test,
        specimen=rig.specimen.name,
        rig_name=rig.name,
        rig_text=rig_file.read_text(encoding="utf-8"),
        channel_ids=rig.channel_ids,
        reading_units=tuple(channel.reading_unit for channel in rig.channels),
        rate_hz=stand_in.rate_hz,
        start_utc_ns=(1_700_000_000 + when_s) * 10**9,
        notes=notes,
    )
    impacts = stand_in.motion.impacts_s
    times = {
        "armed": stand_in.upright_s,
        "holding": stand_in.upright_s + stand_in.pull_s + 0.5,
        "released": stand_in.release_s,
        "rocking": float(impacts[0]),
        "at_rest": float(impacts[-1]) + 0.5,
    }
    scaling = Scaling.of(rig.channels)
    journal = folder / f"{test}_{when_s}.journal"
    with JournalWriter(journal, header) as writer:
        end = int(stand_in.end_s * stand_in.rate_hz) - stand_in.block
        for first in range(0, end, stand_in.block):
            writer.append_block(first, scaling.to_readings(stand_in.block_readings(first).astype(np.float64)))
        for kind, time_s in times.items():
            writer.append_event(kind, round(time_s * stand_in.rate_hz), kind, {})
        writer.append_event("end", end, end_text, {"outcome": "complete"})
    return finalise(journal, journal.with_suffix(".h5"))

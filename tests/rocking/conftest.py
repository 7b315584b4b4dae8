"""A release test made from exact Housner motion by code of its own, for the tests of the analysis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from daq_app.config import Rig, Scaling, load_rig, plan_tasks
from daq_app.rocking.theory.housner import FreeRocking, free_rocking

Floats = NDArray[np.float64]

UPRIGHT_S, PULL_S = 1.0, 1.0


@dataclass
class MadeTest:
    """Readings of a whole test and the truth behind them."""

    rig: Rig
    rate_hz: float
    motion: FreeRocking
    readings: Floats
    """(41, n) rig order."""
    si: Floats
    offsets_s: dict[str, float]
    tare: dict[str, float] = field(default_factory=dict)

    @property
    def n_samples(self) -> int:
        return int(self.readings.shape[1])


@dataclass(frozen=True)
class Sway:
    """What a held wall sways by until it is let go from θ0."""

    share: float = 0.0
    """Amplitude over θ0."""
    frequency_hz: float = 1.0

    def factor(self, before_release_s: Floats) -> Floats:
        """θ over θ0 of the held wall; (n,) times to the release."""
        phase = 0.7 - 2.0 * np.pi * self.frequency_hz * before_release_s
        return np.asarray(1.0 + self.share * (np.sin(phase) - np.sin(0.7)))


STILL = Sway()


def rotation_history(motion: FreeRocking, time_s: Floats, sway: Sway = STILL) -> Floats:
    """θ with the wall upright for 1 s, pulled for 1 s, then held until the release."""
    theta, _ = motion.at(time_s)
    ramp = np.clip((time_s - UPRIGHT_S) / PULL_S, 0.0, 1.0)
    smooth = ramp * ramp * (3.0 - 2.0 * ramp)
    held = smooth * sway.factor(motion.release_s - time_s)
    return np.where(time_s < motion.release_s, theta * held, theta)


def sensor_values(
    rig: Rig,
    motion: FreeRocking,
    time_s: Floats,
    offsets_s: dict[str, float],
    rng: np.random.Generator,
    *,
    full: bool = True,
    sway: Sway = STILL,
) -> Floats:
    """Ideal SI values of every channel at its own instants, plus white noise of the channel's rms.

    Without `full`, LVDTs and accelerometers stay at zero: the online analysis does not look at them.
    """
    half = rig.specimen.base_width_m / 2.0
    shock = rng.standard_normal(40) * np.exp(-np.arange(40) / 12.0)
    rows = []
    for channel in rig.channels:
        if not full and channel.family in ("lvdt", "accelerometer"):
            rows.append(np.zeros_like(time_s))
            continue
        t = time_s + offsets_s.get(channel.id, 0.0)
        theta = rotation_history(motion, t, sway)
        pivot = np.where(theta < 0, -half, half)
        x, y, z = channel.position_m
        if channel.family == "wire":
            assert channel.anchor_m is not None
            ax, ay, az = channel.anchor_m
            px = pivot + (x - pivot) * np.cos(theta) + z * np.sin(theta)
            pz = z * np.cos(theta) - (x - pivot) * np.sin(theta)
            start = np.sqrt((ax - x) ** 2 + (ay - y) ** 2 + (az - z) ** 2)
            value = start - np.sqrt((ax - px) ** 2 + (ay - y) ** 2 + (az - pz) ** 2)
        elif channel.family == "lvdt":
            value = np.clip((pivot - x) * np.sin(theta), *channel.range_si)
        elif channel.family == "tiltmeter":
            value = np.zeros_like(t)
            if channel.axis == "x":
                keep = np.exp(-(t[1] - t[0]) / 0.3)
                value = lfilter([1.0 - keep], [1.0, -keep], theta)
        else:
            value = np.zeros_like(t)
            for k, speed in enumerate(motion.speeds_before_rad_s):
                at = int(np.ceil((motion.impacts_s[k] - t[0]) / (t[1] - t[0])))
                stop = min(at + 40, t.size)
                if at < t.size:
                    value[at:stop] += 60.0 * speed * shock[: stop - at]
        rows.append(value + rng.normal(0.0, channel.noise_si, t.size))
    return np.array(rows)


def make_test(
    rig: Rig,
    *,
    phi: float,
    r: float,
    side: int = 1,
    seed: int = 0,
    hold_s: float = 2.5,
    rest_s: float = 2.0,
    skewed: bool = True,
    p_factor: float = 1.0,
    full: bool = False,
    sway_share: float = 0.0,
    sway_hz: float = 1.0,
) -> MadeTest:
    """A whole test; `r` is the truth."""
    specimen = rig.specimen
    release = UPRIGHT_S + PULL_S + hold_s
    motion = free_rocking(
        side * phi * specimen.alpha0_rad,
        r,
        specimen.p_rad_s * p_factor,
        specimen.alpha0_rad,
        release_s=release,
    )
    rate = rig.acquisition.rate_hz
    time = np.arange(round((motion.impacts_s[-1] + rest_s) * rate)) / rate
    offsets: dict[str, float] = {}
    if skewed:
        plan = plan_tasks(rig)
        offsets = {c.channel.id: c.time_offset_s for task in plan.tasks for c in task.channels}
    rng = np.random.default_rng(seed)
    si = sensor_values(rig, motion, time, offsets, rng, full=full, sway=Sway(sway_share, sway_hz))
    readings = Scaling.of(rig.channels).to_readings(si)
    return MadeTest(rig, rate, motion, readings, si, offsets)


@pytest.fixture(scope="session")
def fr1(configs: Path) -> Rig:
    """The shipped rig of FR1."""
    return load_rig(configs / "fr1.toml")


@pytest.fixture(scope="session")
def made(fr1: Rig) -> Callable[..., MadeTest]:
    """`made(phi=…, r=…, side=…, seed=…)`: a test of FR1, kept for the session."""
    kept: dict[tuple[tuple[str, object], ...], MadeTest] = {}

    def make(**arguments: float) -> MadeTest:
        key = tuple(sorted(arguments.items()))
        if key not in kept:
            kept[key] = make_test(fr1, **arguments)  # type: ignore[arg-type]
        return kept[key]

    return make

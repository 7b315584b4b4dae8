"""Readings of an ordinary laboratory: noise from first-order processes, pick-up from harmonics, rounding."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy.signal import lfilter

from daq_app.gap.blind.world.arrays import FloatArray
from daq_app.gap.blind.world.events.scene import Scene
from daq_app.gap.blind.world.sensors.chain import Calibration, as_read, quiet_signals, rounded_readings
from daq_app.gap.blind.world.sensors.faults import Bench, Fault, Place
from daq_app.gap.blind.world.sensors.installation import KICK_RAD_S, SPIKY, Installation, Sizes

_FORGETS: Final = 0.05
"""Share that slow noise forgets with each sample."""
_PINK_TIMES_S: Final = tuple(0.0005 * 8.0**k for k in range(5))
"""Time constants of the first-order processes whose sum is 1/f noise from 0.1 Hz to 300 Hz."""
_MAINS_HZ, _MAINS_SPREAD_HZ = 50.0, 0.03


def bench_readings(
    installation: Installation,
    scene: Scene,
    faults: tuple[Fault, ...],
    calibration: Calibration,
    sizes: Sizes,
    rng: np.random.Generator,
    place: Place,
) -> FloatArray:
    """(channels, n) what the NI channels return for one run of an ordinary laboratory."""
    rig = installation.rig
    rate_hz = scene.rate_hz
    rows = quiet_signals(rig, scene, (*faults, *installation.faults), rng, place)
    samples = np.arange(scene.time_s.size, dtype=np.float64)
    mains_hz = _MAINS_HZ + _MAINS_SPREAD_HZ * rng.uniform(-1.0, 1.0)
    mains_start = rng.uniform(0.0, 2.0 * math.pi)
    for row, channel in enumerate(rig.channels):
        late = installation.skew_s[row] * rate_hz
        signal = np.interp(samples + late, samples, rows[row]) * (1.0 + calibration.gain[row])
        added = _noise(sizes, samples.size, rate_hz, rng)
        phase = mains_start + installation.mains_phase[row]
        added += installation.mains_amplitude[row] * _mains(scene.time_s, mains_hz, phase)
        added += _cable(scene, installation.cable[row], sizes, rng)
        added += _spikes(sizes, samples.size, rate_hz, rng)
        signal += installation.noise_si[row] * added
        rows[row] = as_read(signal, faults, Bench(channel, scene, place, rng)) + calibration.zero_si[row]
    return rounded_readings(rig, rows, installation.step_v)


def _noise(sizes: Sizes, n: int, rate_hz: float, rng: np.random.Generator) -> FloatArray:
    """White, slow and 1/f noise, a zero that is off and walks; in noises."""
    noise = rng.standard_normal(n)
    noise += sizes.get("slow_noise", 0.0) * _first_order(_FORGETS, n, rng)
    pink = sizes.get("pink_noise", 0.0)
    if pink:
        each = pink / math.sqrt(len(_PINK_TIMES_S))
        for constant in _PINK_TIMES_S:
            noise += each * _first_order(-math.expm1(-1.0 / (rate_hz * constant)), n, rng)
    walk = sizes.get("zero_walk", 0.0)
    if walk:
        noise += walk / math.sqrt(n) * np.cumsum(rng.standard_normal(n))
    return np.asarray(noise + sizes.get("zero_start", 0.0) * rng.standard_normal())


def _first_order(forgets: float, n: int, rng: np.random.Generator) -> FloatArray:
    """First-order process of unit variance, stationary from its first sample."""
    keep = 1.0 - forgets
    driven = math.sqrt(1.0 - keep * keep) * rng.standard_normal(n)
    return np.asarray(lfilter([1.0], [1.0, -keep], driven, zi=[keep * rng.standard_normal()])[0])


def _mains(time_s: FloatArray, frequency_hz: float, phase: float) -> FloatArray:
    """Fundamental of unit amplitude, third of its third harmonic and a tenth of its second at most."""
    turn = 2.0 * math.pi * frequency_hz * time_s + phase
    share = 0.5 + 0.5 * math.sin(phase)
    return np.asarray(
        np.sin(turn) + share / 3.0 * np.sin(3.0 * turn + phase) + share / 10.0 * np.sin(2.0 * turn)
    )


def _cable(scene: Scene, susceptibility: float, sizes: Sizes, rng: np.random.Generator) -> FloatArray:
    """Bursts and steps that impacts make in a cable; in noises."""
    added = np.zeros_like(scene.time_s)
    shake, step = sizes.get("cable_shake", 0.0), sizes.get("cable_step", 0.0)
    if not susceptibility or not (shake or step):
        return added
    for start, jump in zip(scene.impact_times, scene.impact_jumps, strict=True):
        low, high = np.searchsorted(scene.time_s, [start, start + 0.6])
        t = scene.time_s[low:high] - start
        kick = susceptibility * abs(jump) / KICK_RAD_S
        decay, frequency = rng.uniform(0.02, 0.1), rng.uniform(4.0, 40.0)
        burst = np.exp(-t / decay) * np.sin(2.0 * math.pi * frequency * t + rng.uniform(0.0, 2.0 * math.pi))
        added[low:high] += shake * kick * rng.uniform(0.3, 1.0) * burst
        added[low:] += step * kick * rng.standard_normal()
    return added


def _spikes(sizes: Sizes, n: int, rate_hz: float, rng: np.random.Generator) -> FloatArray:
    added = np.zeros(n)
    if "spikes" in sizes and rng.uniform() < SPIKY:
        count = rng.poisson(sizes["spikes"] * n / rate_hz)
        at = rng.integers(0, n, count)
        added[at] += rng.uniform(5.0, 25.0, count) * rng.choice([-1.0, 1.0], count)
    return added

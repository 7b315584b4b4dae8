"""Readings of the laboratories that are left out: the imperfections of `bench_chain` by another chain.

Noise has its spectrum by random phases, signal and noise pass an anti-alias filter together, cables charge up
with motion, pick-up is a clipped wave that swells, and the converter cuts off with dither and bends.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy.signal import butter, sosfilt, sosfilt_zi

from daq_app.gap.blind.world.arrays import FloatArray
from daq_app.gap.blind.world.events.scene import Scene
from daq_app.gap.blind.world.sensors.chain import Calibration, as_read, clipped_readings, quiet_signals
from daq_app.gap.blind.world.sensors.faults import Bench, Fault, Place
from daq_app.gap.blind.world.sensors.installation import KICK_RAD_S, SPIKY, Installation, Sizes

_PASS: Final = 0.7
"""Corner of the anti-alias filter as a share of half the sampling rate."""
_SLOW_CORNER_HZ: Final = 35.0
"""Corner of slow noise."""
_LOWEST_HZ: Final = 0.05
_CLIPS_AT: Final = 0.8
"""Level at which the wave that is picked up is cut, of its amplitude."""
_BEND: Final = 3.0
"""Integral non-linearity of a converter at half of its range, in steps, at most."""
_FULL_SCALE: Final = 10.0


def field_readings(
    installation: Installation,
    scene: Scene,
    faults: tuple[Fault, ...],
    calibration: Calibration,
    sizes: Sizes,
    rng: np.random.Generator,
    place: Place,
) -> FloatArray:
    """(channels, n) what the NI channels return for one run of a left-out laboratory."""
    rig = installation.rig
    rate_hz = scene.rate_hz
    rows = quiet_signals(rig, scene, (*faults, *installation.faults), rng, place)
    alias = butter(3, _PASS, output="sos")
    mains = _picked_up(scene.time_s, rng)
    exponent = rng.uniform(0.7, 1.3)
    for row, channel in enumerate(rig.channels):
        signal = _shifted(rows[row], installation.skew_s[row] * rate_hz) * (1.0 + calibration.gain[row])
        added = _coloured(sizes, signal.size, rate_hz, exponent, rng)
        quarter = int(installation.mains_phase[row] / (2.0 * math.pi) * rate_hz / 50.0)
        added += installation.mains_amplitude[row] * np.roll(mains, quarter)
        added += _charged_cable(scene, installation.cable[row], sizes, rate_hz, rng)
        added += _glitches(sizes, signal.size, rate_hz, rng)
        signal = signal + installation.noise_si[row] * added
        signal = sosfilt(alias, signal, zi=sosfilt_zi(alias) * signal[0])[0]
        rows[row] = as_read(signal, faults, Bench(channel, scene, place, rng)) + calibration.zero_si[row]
    return _converted(clipped_readings(rig, rows), installation, rng)


def _shifted(signal: FloatArray, samples: float) -> FloatArray:
    """A signal sampled later by a share of a sample or by several: a phase in its spectrum, ends mirrored."""
    both = np.concatenate([signal, signal[::-1]])
    turn = np.exp(2j * math.pi * np.fft.rfftfreq(both.size) * samples)
    return np.asarray(np.fft.irfft(np.fft.rfft(both) * turn, both.size)[: signal.size])


def _coloured(sizes: Sizes, n: int, rate_hz: float, exponent: float, rng: np.random.Generator) -> FloatArray:
    """Noise of white, slow and 1/f parts by random phases of its spectrum, and a zero that settles."""
    length = 1 << (n - 1).bit_length()
    hz: FloatArray = np.asarray(np.fft.rfftfreq(length, 1.0 / rate_hz), dtype=np.float64)
    power: FloatArray = np.ones(hz.size)
    power = power + _of_variance(1.0 / (1.0 + (hz / _SLOW_CORNER_HZ) ** 4), sizes.get("slow_noise", 0.0))
    power = power + _of_variance(1.0 / np.maximum(hz, _LOWEST_HZ) ** exponent, sizes.get("pink_noise", 0.0))
    phases = np.exp(2j * math.pi * rng.uniform(size=hz.size))
    magnitude = np.sqrt(power * rng.exponential(size=hz.size) * length)
    noise = np.fft.irfft(magnitude * phases, length)[:n]
    time = np.arange(n) / n
    settles = np.exp(-time / rng.uniform(0.1, 0.8)) * rng.standard_normal() + time * rng.standard_normal()
    return np.asarray(
        noise + sizes.get("zero_walk", 0.0) * settles + sizes.get("zero_start", 0.0) * rng.standard_normal()
    )


def _of_variance(shape: FloatArray, rms: float) -> FloatArray:
    """A spectrum of this shape whose noise has the rms, where 1 everywhere has an rms of 1."""
    shape = shape.copy()
    shape[0] = 0.0
    return np.asarray(rms * rms * shape / np.mean(shape))


def _picked_up(time_s: FloatArray, rng: np.random.Generator) -> FloatArray:
    """The mains: a clipped wave of 50 ± 0.03 Hz that swells by a fifth within seconds."""
    hz, start = 50.0 + rng.uniform(-0.03, 0.03), rng.uniform(0.0, 2.0 * math.pi)
    swell = 1.0 + 0.2 * np.sin(2.0 * math.pi * rng.uniform(0.05, 0.4) * time_s + start)
    wave = np.sin(2.0 * math.pi * hz * time_s + start)
    return np.asarray(swell * np.clip(wave, -_CLIPS_AT, _CLIPS_AT) / _CLIPS_AT)


def _charged_cable(
    scene: Scene, susceptibility: float, sizes: Sizes, rate_hz: float, rng: np.random.Generator
) -> FloatArray:
    """Impacts whip a cable, its charge leaks away: filtered random bursts, and what the clamp has moved."""
    shake, step = sizes.get("cable_shake", 0.0), sizes.get("cable_step", 0.0)
    added = np.zeros_like(scene.time_s)
    if not susceptibility or not (shake or step):
        return added
    soft = butter(2, [6.0, 45.0], btype="bandpass", fs=rate_hz, output="sos")
    for start, jump in zip(scene.impact_times, scene.impact_jumps, strict=True):
        low, high = np.searchsorted(scene.time_s, [start, start + 0.5])
        t = scene.time_s[low:high] - start
        if t.size == 0:
            continue
        kick = susceptibility * abs(jump) / KICK_RAD_S
        burst = sosfilt(soft, rng.standard_normal(t.size) * np.exp(-t / 0.05))
        largest = float(np.max(np.abs(burst))) or 1.0
        added[low:high] += shake * kick * burst / largest
        added[low:] += step * kick * float(rng.laplace()) / math.sqrt(2.0)
    return added


def _glitches(sizes: Sizes, n: int, rate_hz: float, rng: np.random.Generator) -> FloatArray:
    """Pulses of two to four samples, one way and back."""
    added = np.zeros(n)
    if "spikes" not in sizes or rng.uniform() >= SPIKY:
        return added
    for at in rng.integers(0, n - 4, rng.poisson(sizes["spikes"] * n / rate_hz)):
        width = int(rng.integers(1, 3))
        height = rng.uniform(5.0, 25.0) * rng.choice([-1.0, 1.0])
        added[at : at + width] += height
        added[at + width : at + 2 * width] -= 0.7 * height
    return added


def _converted(volts: FloatArray, installation: Installation, rng: np.random.Generator) -> FloatArray:
    """Cut off to steps after a dither of one step, by converters whose characteristic bends."""
    steps = installation.step_v[:, None]
    bend = _BEND * rng.uniform(-1.0, 1.0, (volts.shape[0], 1))
    bent = volts + bend * steps * np.sin(math.pi * volts / _FULL_SCALE)
    return np.asarray(np.floor(bent / steps + rng.uniform(size=volts.shape)) * steps)

"""What sensors and electronics do wrong, channel by channel.

A fault of the first kind changes the signal before noise is added (`RESPONSES`), one of the second what
the electronics make of signal and noise (`ELECTRONICS`). Polarity and swapped channels are wiring.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from daq_app.config.rig import Channel
from daq_app.gap.blind.world.arrays import FloatArray
from daq_app.gap.blind.world.events.scene import Scene
from daq_app.gap.blind.world.sensors.instruments import first_order, ideal

Parameters = dict[str, float]


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault and the channels that have it."""

    name: str
    parameters: Parameters
    targets: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Place:
    """A run's place in its campaign."""

    campaign_s: float
    """Time since the first run."""
    largest_rad: float
    """Largest planned release rotation."""


@dataclass(frozen=True, slots=True)
class Bench:
    """What a fault may depend on."""

    channel: Channel
    scene: Scene
    place: Place
    rng: np.random.Generator = field(repr=False)


Apply = Callable[[FloatArray, Parameters, Bench], FloatArray]


def _delayed(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    samples = np.arange(signal.size) - q["tau_s"] * bench.scene.rate_hz
    return np.asarray(np.interp(samples, np.arange(signal.size), signal))


def _gain(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    return signal * (1.0 + q["error"])


def _drift(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    # The zero was taken upright before the test: at the release the drift has run for a while.
    per_rad = {"lvdt": 0.65, "wire": 2.0, "accelerometer": 9.8, "tiltmeter": 1.0}[bench.channel.family]
    slope = q["rate_rad_s"] * per_rad
    return np.asarray(signal + slope * (bench.scene.time_s - bench.scene.time_s[0]))


def _slow(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    return first_order(signal, q["tau_s"], 1.0 / bench.scene.rate_hz)


def _filter_delay(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    """Linear-phase filter of length 2 τ: a moving average (Hann), and what is missing to a delay of τ."""
    length = max(int(2.0 * q["tau_s"] * bench.scene.rate_hz) - 1, 0) | 1
    taps = np.hanning(length + 2)[1:-1]
    taps /= taps.sum()
    start = np.full(length - 1, signal[0])
    averaged = np.convolve(np.concatenate([start, signal]), taps, mode="valid")
    missing_s = q["tau_s"] - (length - 1) / 2.0 / bench.scene.rate_hz
    return _delayed(averaged, {"tau_s": missing_s}, bench)


def _saturation(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    """Clips at a level that cuts the share `cut` off what the largest planned release would give."""
    x, _, z = bench.channel.position_m
    lever = z if bench.channel.family == "wire" else 2.0 * abs(x)
    limit = (1.0 - q["cut"]) * bench.place.largest_rad * lever
    return np.asarray(np.clip(signal, -limit, limit))


def _wire_sag(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    return signal - q["kappa_1_m"] * signal**2


def not_straight(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    """An S and an arch over the range, shares of it, whose ends lie on the straight line."""
    low, high = bench.channel.range_si
    span = high - low
    place, upright = math.pi * (signal - low) / span, -math.pi * low / span
    odd = np.sin(2.0 * place) - math.sin(2.0 * upright)
    even = np.sin(place) - math.sin(upright)
    return np.asarray(signal + span * (q["odd"] * odd + q["even"] * even))


def _wire_inertia(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    """Second-order response of the drum and spring (bilinear)."""
    natural, zeta, rate = 2.0 * math.pi * q["frequency_hz"], q["zeta"], bench.scene.rate_hz
    k = 2.0 * rate
    a = np.array([k * k + 2 * zeta * natural * k + natural**2, 2 * (natural**2 - k * k), 0.0])
    a[2] = k * k - 2 * zeta * natural * k + natural**2
    b = natural**2 * np.array([1.0, 2.0, 1.0])
    shifted: FloatArray = lfilter(b / a[0], a / a[0], signal - signal[0])
    return np.asarray(shifted + signal[0])


def _cubic_gain(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    span = max(abs(v) for v in bench.channel.range_si)
    return signal * (1.0 + q["share"] * (signal / (0.5 * span)) ** 2)


def _backlash(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    """Play: the reading moves only once the slack on one side is used up."""
    play = q["play_m"] / 2.0
    out = np.empty_like(signal)
    held = signal[0]
    for k, value in enumerate(signal.tolist()):
        held = min(max(held, value - play), value + play)
        out[k] = held
    return out


def _loose_bracket(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    """The bracket hits at impacts: it rings, and stays displaced a little until the next."""
    scene, out = bench.scene, signal.copy()
    omega = 2.0 * math.pi * q["frequency_hz"]
    for start, jump in zip(scene.impact_times, scene.impact_jumps, strict=True):
        low = int(np.searchsorted(scene.time_s, start))
        t = scene.time_s[low:] - start
        size = q["size_si"] * abs(jump) * bench.rng.uniform(0.5, 1.5)
        out[low:] += size * np.exp(-t / 0.1) * np.sin(omega * t)
        out[low:] += 0.15 * size * bench.rng.standard_normal()
    return out


def _amplifier_temperature(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    warmed = 1.0 - math.exp(-bench.place.campaign_s / q["warm_up_s"])
    return signal * (1.0 + q["share"] * warmed)


def _hum(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    phase = bench.rng.uniform(0.0, 2.0 * math.pi)
    size = q["times_noise"] * bench.channel.noise_si
    return signal + size * np.sin(2.0 * math.pi * 50.0 * bench.scene.time_s + phase)


def _dropout(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    """The reading freezes now and then."""
    out = signal.copy()
    count = max(1, round(q["share"] * out.size / (q["duration_s"] * bench.scene.rate_hz)))
    for start in bench.rng.integers(0, out.size, count):
        out[start : start + round(q["duration_s"] * bench.scene.rate_hz)] = out[start]
    return out


def _quantisation(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    step = q["times_noise"] * bench.channel.noise_si
    return np.asarray(np.round(signal / step) * step)


def _spikes(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    out = signal.copy()
    count = bench.rng.poisson(q["per_second"] * out.size / bench.scene.rate_hz)
    at = bench.rng.integers(0, out.size, count)
    out[at] += q["times_noise"] * bench.channel.noise_si * bench.rng.choice([-1.0, 1.0], count)
    return out


def _turned_mount(signal: FloatArray, q: Parameters, bench: Bench) -> FloatArray:
    """A mount that is turned by `angle_rad` measures a share of its cross axis."""
    channel = bench.channel
    across = {"x": "z", "z": "x"} if channel.family == "accelerometer" else {"x": "y", "y": "x"}
    other = channel.model_copy(update={"axis": across.get(channel.axis, "x")})
    turn = q["angle_rad"]
    return np.asarray(math.cos(turn) * signal + math.sin(turn) * ideal(other, bench.scene))


RESPONSES: dict[str, Apply] = {
    "turned_mount": _turned_mount,
    "gain": _gain,
    "drift": _drift,
    "lag": _delayed,
    "slow_response": _slow,
    "filter_delay": _filter_delay,
    "saturation": _saturation,
    "wire_sag": _wire_sag,
    "wire_inertia": _wire_inertia,
    "not_straight": not_straight,
    "cubic_gain": _cubic_gain,
    "backlash": _backlash,
    "loose_bracket": _loose_bracket,
    "amplifier_temperature": _amplifier_temperature,
}
ELECTRONICS: dict[str, Apply] = {
    "hum": _hum,
    "dropout": _dropout,
    "quantisation": _quantisation,
    "spikes": _spikes,
}


def through_electronics(signal: FloatArray, faults: Iterable[Fault], bench: Bench) -> FloatArray:
    """A signal with noise, (n,), after those faults of the second kind that its channel has."""
    for fault in faults:
        if fault.name in ELECTRONICS and bench.channel.id in fault.targets:
            signal = ELECTRONICS[fault.name](signal, fault.parameters, bench)
    return signal

"""From a scene to the readings of one run: calibration, noise, faults, wiring, ADC."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from daq_app.config import Rig, Scaling
from daq_app.config.rig import Channel
from daq_app.gap.blind.world.arrays import FloatArray
from daq_app.gap.blind.world.events.scene import Scene
from daq_app.gap.blind.world.sensors.faults import RESPONSES, Bench, Fault, Place, through_electronics
from daq_app.gap.blind.world.sensors.instruments import ideal

CALIBRATION_TOLERANCE = 0.003
ADC_STEP_V = 20.5 / 65536
"""16 bits over ±10.25 V; a binary fraction, so that files of readings pack well."""
_TARE_SAMPLES = 2000
_ZERO_WALK = 0.2
"""Zero of a channel from run to run, in units of its noise."""


@dataclass(frozen=True, slots=True)
class Calibration:
    """What every sensor of a case has of its own, the same in all runs."""

    gain: FloatArray
    """(n,) relative gain error."""
    zero_si: FloatArray
    """(n,) true zero, SI: the tare removes it but for its own noise."""
    tare_reading: Mapping[str, float]
    """What the operator found upright before the first run."""


def draw_calibration(
    rig: Rig, rng: np.random.Generator, tolerance: float = CALIBRATION_TOLERANCE
) -> Calibration:
    """Gain errors of `tolerance` and zeros of half a per cent of the range, with the tare that was taken."""
    n = len(rig.channels)
    gain = tolerance * rng.standard_normal(n)
    span = np.array([c.range_si[1] - c.range_si[0] for c in rig.channels])
    noise = np.array([c.noise_si for c in rig.channels])
    zero = 0.005 * span * rng.uniform(-1.0, 1.0, n)
    measured_zero = zero + noise / np.sqrt(_TARE_SAMPLES) * rng.standard_normal(n)
    factor = Scaling.of(rig.channels).gain[:, 0]
    tare = {c.id: float(v) for c, v in zip(rig.channels, measured_zero / factor, strict=True)}
    return Calibration(gain, zero, tare)


def quiet_signals(
    rig: Rig, scene: Scene, faults: Sequence[Fault], rng: np.random.Generator, place: Place
) -> FloatArray:
    """(channels, n) signals in SI without noise and calibration, with the faults of the first kind."""
    rows = np.empty((len(rig.channels), scene.time_s.size))
    for row, channel in enumerate(rig.channels):
        mine = [fault for fault in faults if channel.id in fault.targets]
        shift = sum(fault.parameters["anchor_m"] for fault in mine if fault.name == "wire_cosine")
        signal = ideal(channel, scene, shift)
        bench = Bench(channel, scene, place, rng)
        for fault in mine:
            if fault.name in RESPONSES:
                signal = RESPONSES[fault.name](signal, fault.parameters, bench)
        rows[row] = signal
    return _wired(rig, rows, faults)


def readings(
    rig: Rig,
    scene: Scene,
    faults: Sequence[Fault],
    calibration: Calibration,
    skew_s: Mapping[str, float],
    rng: np.random.Generator,
    place: Place,
) -> FloatArray:
    """(channels, n) what the NI channels return for one run, quantised."""
    rows = quiet_signals(rig, scene, faults, rng, place)
    for row, channel in enumerate(rig.channels):
        signal = rows[row]
        part = min(max(skew_s.get(channel.id, 0.0) * scene.rate_hz, 0.0), 1.0)
        signal[:-1] += part * np.diff(signal)
        signal *= 1.0 + calibration.gain[row]
        noise = rng.standard_normal(signal.size, dtype=np.float32)
        walk = _ZERO_WALK * rng.standard_normal()
        signal += channel.noise_si * (noise + walk)
        rows[row] = as_read(signal, faults, Bench(channel, scene, place, rng)) + calibration.zero_si[row]
    return rounded_readings(rig, rows, finest_steps(rig.channels))


def as_read(signal: FloatArray, faults: Sequence[Fault], bench: Bench) -> FloatArray:
    """A signal with noise, (n,), SI, after its electronics, as far as its sensor goes."""
    return within_range(through_electronics(signal, faults, bench), bench.channel, faults)


def within_range(signal: FloatArray, channel: Channel, faults: Sequence[Fault]) -> FloatArray:
    """A reading (n,), SI, as far as its sensor goes: where its leads are reversed, its range is as well."""
    low, high = channel.range_si
    if any(fault.name == "polarity" and channel.id in fault.targets for fault in faults):
        low, high = -high, -low
    return np.clip(signal, low, high)


def finest_steps(channels: Sequence[Channel]) -> FloatArray:
    """Smallest step of each channel's converter, (channels,), in the unit of its reading."""
    return np.array([ADC_STEP_V if c.measurement == "voltage" else 1e-7 for c in channels])


def rounded_readings(rig: Rig, rows: FloatArray, steps: FloatArray) -> FloatArray:
    """(channels, n) readings of signals in SI, rounded to the steps (channels,) of their converters."""
    each = steps[:, None]
    return np.asarray(np.round(clipped_readings(rig, rows) / each) * each)


def clipped_readings(rig: Rig, rows: FloatArray) -> FloatArray:
    """(channels, n) readings of signals in SI, within what each module converts."""
    limits = np.array([_limits(c.input_range_v, c.measurement) for c in rig.channels])
    readings_of_rows = Scaling.of(rig.channels).to_readings(rows)
    return np.asarray(np.clip(readings_of_rows, limits[:, :1], limits[:, 1:]))


def _limits(range_v: tuple[float, float], measurement: str) -> tuple[float, float]:
    return (1.025 * range_v[0], 1.025 * range_v[1]) if measurement == "voltage" else (-np.inf, np.inf)


def _wired(rig: Rig, rows: FloatArray, faults: Sequence[Fault]) -> FloatArray:
    """Polarity, exchanged plugs, crosstalk."""
    index = {channel.id: row for row, channel in enumerate(rig.channels)}
    for fault in faults:
        at = [index[name] for name in fault.targets]
        if fault.name == "polarity":
            rows[at] = -rows[at]
        elif fault.name == "swap":
            rows[at] = rows[at[::-1]]
        elif fault.name == "crosstalk":
            # As the multiplexer does it: a share of the channel scanned before, in volts.
            scaling = Scaling.of(rig.channels).gain[:, 0]
            before = [max(row - 1, 0) for row in at]
            rows[at] += fault.parameters["share"] * rows[before] * (scaling[at] / scaling[before])[:, None]
    return rows

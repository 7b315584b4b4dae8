"""Go or no-go for every channel from a few seconds of the wall standing still.

The limits: noise above 3 (10) times the expected rms is doubtful (bad); hum above 2 (10) times it;
a reading at the edge of the module's range is saturated; a value that never changes although the
expected noise is larger than the converter's step is stuck.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Set
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.acquisition.checks.check_model import ChannelCheck, Finding, SensorCheck, Verdict
from daq_app.config.families import AUXILIARY
from daq_app.config.rig import Channel, Rig
from daq_app.config.scaling import Scaling
from daq_app.config.wording import signed

Floats = NDArray[np.float64]

NOISE_DOUBTFUL, NOISE_BAD = 3.0, 10.0
QUIET_SHARE: Final = 0.2
"""Less than this share of the expected noise: nothing is connected, or it is stuck."""
HUM_DOUBTFUL, HUM_BAD = 2.0, 10.0
EDGE_SHARE: Final = 0.005
"""Within this share of the module's range from either end a reading is saturated."""
DRIFT_FACTOR: Final = 5.0
END_OF_TRAVEL_SHARE: Final = 0.001
"""Within this share of its range from either end a sensor stands at its stop. Assumed."""
CALIBRATION_SOON: Final = dt.timedelta(days=30)
RATE_TOLERANCE: Final = 1e-3
LEAST_FREE_S: Final = 1800.0
"""The disk must hold at least half an hour of raw data."""
LEAST_S: Final = 1.0
_AUXILIARY_BEYOND: Final = 0.01
"""Share of its range by which an auxiliary channel may stand beyond an end at rest. Assumed; raising it hides
a zero that is off."""
_CONVERTER_BITS: Final = 16
_MAINS_HZ: Final = (50.0, 60.0)
_N_HARMONICS: Final = 4


@dataclass(frozen=True, slots=True)
class Conditions:
    """What is known beside the samples."""

    rate_hz: float
    """Rate read back from the hardware."""
    planned_rate_hz: float
    free_bytes: int
    """Space on the disk of the runs; negative when not known."""
    today: dt.date
    tare: Mapping[str, float]
    """Reading at zero beyond the certificate's offset, by channel id; empty before zeroing."""
    overloaded: Set[str] = frozenset()


def check_at_rest(rig: Rig, si: NDArray[np.floating], conditions: Conditions) -> SensorCheck:
    """Check `si` (n_channels, n), rows in rig order, tared and scaled as published, wall standing still.

    Raises `ValueError` if the rows do not fit the rig or there is less than a second of data.
    """
    if si.shape[0] != len(rig.channels):
        raise ValueError(f"{si.shape[0]} channels of data for {len(rig.channels)} channels of the rig")
    if si.shape[1] < LEAST_S * conditions.rate_hz:
        raise ValueError("the check needs at least one second of data without a gap")
    values = si.astype(np.float64)
    readings = Scaling.of(rig.channels, conditions.tare).to_readings(values)
    untared = Scaling.of(rig.channels).to_si(readings)
    split = disturbance(np.where(np.isfinite(values), values, 0.0), conditions.rate_hz)
    checks = tuple(
        _check_channel(rig.channels[row], row, values[row], untared[row], readings[row], split, conditions)
        for row in range(len(rig.channels))
    )
    return SensorCheck(
        checks,
        tuple(_check_rig(rig, conditions)),
        taken_utc=dt.datetime.now(dt.UTC).isoformat(timespec="seconds"),
    )


def _check_rig(rig: Rig, conditions: Conditions) -> list[Finding]:
    findings = []
    deviation = abs(conditions.rate_hz / conditions.planned_rate_hz - 1.0)
    if deviation > RATE_TOLERANCE:
        findings.append(
            Finding(
                "rate",
                Verdict.NO_GO,
                f"The hardware samples at {conditions.rate_hz:g} Hz instead of the planned "
                f"{conditions.planned_rate_hz:g} Hz. Run the planner again for the modules in the chassis.",
            )
        )
    need = LEAST_FREE_S * conditions.rate_hz * len(rig.channels) * 8
    if 0 <= conditions.free_bytes < need:
        findings.append(
            Finding(
                "disk",
                Verdict.NO_GO,
                f"The disk has {conditions.free_bytes / 1e9:.1f} GB left; {need / 1e9:.1f} GB are needed for "
                "half an hour. Free some space or choose another folder for the runs.",
            )
        )
    return findings


def _check_channel(
    channel: Channel,
    row: int,
    values: Floats,
    untared: Floats,
    readings: Floats,
    split: Disturbance,
    conditions: Conditions,
) -> ChannelCheck:
    findings = _calibration(channel, conditions.today)
    noise, hum = float(split.noise[row]), float(split.hum[row])
    mean = float(values.mean())
    if not np.isfinite(values).all():
        findings.append(
            Finding("missing", Verdict.NO_GO, "Samples are missing. Check the module and its cable.")
        )
        noise = hum = float("nan")
    else:
        signal = _signal(channel, untared, readings, channel.id in conditions.overloaded)
        findings.extend(signal)
        if not signal:
            # A dead or saturated channel has no noise worth judging.
            findings.extend(
                _quality(channel, noise, hum, float(split.mains_hz[row]), float(split.drift[row]))
            )
    return ChannelCheck(channel.id, channel.family, tuple(findings), mean, noise, channel.noise_si, hum)


def _calibration(channel: Channel, today: dt.date) -> list[Finding]:
    due = channel.certificate.due
    if due < today:
        text = f"Calibration {channel.certificate.number} ran out on {due}. Calibrate or exchange the sensor."
        return [Finding("calibration", Verdict.NO_GO, text)]
    if due - today <= CALIBRATION_SOON:
        return [Finding("calibration", Verdict.CAUTION, f"Calibration runs out on {due}.")]
    return []


def converter_step_si(channel: Channel) -> float:
    """One step of a 16-bit converter over the input range, in SI; 0 where the driver scales."""
    if channel.measurement != "voltage":
        return 0.0
    low, high = channel.input_range_v
    return float((high - low) / 2**_CONVERTER_BITS / channel.sensitivity_reading_per_si)


def _signal(channel: Channel, untared: Floats, readings: Floats, overloaded: bool) -> list[Finding]:
    """Saturated, out of range, stuck, or no signal at all."""
    low, high = channel.input_range_v
    edge = EDGE_SHARE * (high - low)
    at_edge = channel.measurement == "voltage" and (
        readings.max() >= high - edge or readings.min() <= low + edge
    )
    if at_edge or overloaded:
        text = f"Saturated: the input is at the end of its range ({low:g} to {high:g} V). "
        return [Finding("saturated", Verdict.NO_GO, text + "Check supply, wiring and the sensor's travel.")]
    spread = float(np.ptp(untared))
    centre = float(np.median(untared))
    smallest, largest = channel.range_si
    if channel.auxiliary:  # a rope that hangs loose reads zero, which may be the end of the range
        beyond = _AUXILIARY_BEYOND * (largest - smallest)
        smallest, largest = smallest - beyond, largest + beyond
    dead = f"reads {signed(float(np.median(readings)), '.3g')} {channel.reading_unit} at rest"
    if not smallest <= centre <= largest:
        text = (
            f"Out of range: it {dead}, which no quantity within its range gives. Check wiring and mounting."
        )
        return [Finding("range", Verdict.NO_GO, text)]
    expected = channel.noise_si
    rms = float(untared.std())
    inset = END_OF_TRAVEL_SHARE * (largest - smallest)
    travels = AUXILIARY[channel.family].travels if channel.auxiliary else channel.family != "accelerometer"
    if travels and not smallest + inset < centre < largest - inset:
        text = f"End of travel: it {dead}, the stop of its range. Set it back, or use a longer sensor."
        return [Finding("travel", Verdict.NO_GO, text)]
    if spread == 0.0 and expected >= 0.5 * converter_step_si(channel):
        return [
            Finding("stuck", Verdict.NO_GO, f"Stuck: it {dead} and never changes. Check sensor and module.")
        ]
    if rms < QUIET_SHARE * expected and expected >= 2.0 * converter_step_si(channel):
        text = f"No signal: it {dead} without the noise of a living sensor. Check plug and supply."
        return [Finding("silent", Verdict.NO_GO, text)]
    return []


def _quality(channel: Channel, noise: float, hum: float, mains_hz: float, drift: float) -> list[Finding]:
    """Noise, hum and drift of a channel that lives."""
    findings = []
    allowed = float(np.hypot(channel.noise_si, converter_step_si(channel)))
    if hum > HUM_DOUBTFUL * allowed:
        verdict = Verdict.NO_GO if hum > HUM_BAD * allowed else Verdict.CAUTION
        times = f"{hum / allowed:.0f} times the expected noise"
        text = f"Mains hum at {mains_hz:g} Hz, {times}. Check shield and ground."
        findings.append(Finding("hum", verdict, text))
    if noise > NOISE_DOUBTFUL * allowed:
        verdict = Verdict.NO_GO if noise > NOISE_BAD * allowed else Verdict.CAUTION
        text = f"Noise {noise / allowed:.1f} times the expected figure. Check plug, cable and supply."
        findings.append(Finding("noise", verdict, text))
    if drift > DRIFT_FACTOR * allowed:
        text = f"Drifts by {drift / allowed:.0f} times its noise while the wall should stand still."
        findings.append(Finding("drift", Verdict.CAUTION, text))
    return findings


@dataclass(frozen=True, slots=True)
class Disturbance:
    """What a still channel shows beside its mean, SI; arrays of shape (n_channels,)."""

    noise: Floats
    """rms of what is left when drift and hum are taken out."""
    hum: Floats
    """rms at the mains frequency and its harmonics."""
    mains_hz: Floats
    drift: Floats
    """Change along the fitted line over the record."""


def disturbance(values: Floats, rate_hz: float) -> Disturbance:
    """Split `values` (n_channels, n), finite, at least a second long.

    A straight line is taken out, then mains and its harmonics are fitted by least squares (50 and
    60 Hz, the larger counts); what is left is noise.
    """
    n = values.shape[1]
    time = np.arange(n) / rate_hz
    centred = time - time.mean()
    slope = values @ centred / (centred @ centred)
    rest = values - values.mean(axis=1, keepdims=True) - slope[:, None] * centred
    power = np.mean(rest**2, axis=1)
    hum_power = np.zeros(values.shape[0])
    mains_hz = np.full(values.shape[0], _MAINS_HZ[0])
    for mains in _MAINS_HZ:
        frequencies = [mains * k for k in range(1, _N_HARMONICS + 1) if mains * k < 0.45 * rate_hz]
        phases = 2.0 * np.pi * np.outer(frequencies, time)
        basis = np.concatenate((np.cos(phases), np.sin(phases)))
        # Whole periods make the rows orthogonal; over a second or more the error is below a percent.
        found = 0.5 * np.sum((2.0 / n * (rest @ basis.T)) ** 2, axis=1)
        mains_hz = np.where(found > hum_power, mains, mains_hz)
        hum_power = np.maximum(hum_power, found)
    return Disturbance(
        noise=np.sqrt(np.maximum(power - hum_power, 0.0)),
        hum=np.sqrt(hum_power),
        mains_hz=mains_hz,
        drift=np.abs(slope) * time[-1],
    )

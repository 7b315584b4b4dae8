"""Zeroing: the mean reading of every channel with the wall upright and at rest, or why it cannot be taken."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Channel, Rig
from daq_app.config.scaling import Scaling
from daq_app.config.wording import true_minus

Floats = NDArray[np.float64]

UNZEROED: Final = (
    "No zero has been taken: r on screen is off by about 3 %. The result after the test is not, it takes "
    "its zero from the wall at rest."
)
"""What a viewer says beside a live r that rests on no tare."""

_LARGEST_SHARE: Final = 0.25
"""A zero further off than this share of the sensor's range is a fault, not a zero."""
_NOISE_FACTOR: Final = 6.0
"""Scatter above this many times the expected noise is motion, hum or a loose plug."""
_DRIFT_FACTOR: Final = 4.0
_UPRIGHT_SHARE: Final = 0.05
"""Largest |tilt| / α at which the wall counts as upright: zeroing a pulled wall would hide θ0."""


class NotSteady(Exception):
    """The zero cannot be taken now: every reason, and what to do."""


@dataclass(frozen=True, slots=True)
class Tare:
    """What is subtracted from each reading beyond the certificate's offset."""

    readings: dict[str, float] = field(default_factory=dict)
    """Channel id → reading, unit of the reading."""
    record: dict[str, Any] = field(default_factory=dict)
    """When, on which samples, with which scatter: goes into the run."""


def take_tare(rig: Rig, readings: Floats, first_sample: int, resolution: Floats | None = None) -> Tare:
    """The tare of `readings` (n_channels, n), rows in rig order. Raises `NotSteady` with all reasons.

    `resolution` (n_channels,) is one step of each converter, unit of the reading: a channel may
    scatter by some steps even where its sensor's noise is smaller.
    """
    channels = rig.channels
    scaling = Scaling.of(channels)
    si = scaling.to_si(readings)
    half = readings.shape[1] // 2
    step = np.zeros(len(channels)) if resolution is None else resolution * np.abs(scaling.gain[:, 0])
    allowed = np.array([channel.noise_si for channel in channels]) + step
    mean, scatter = si.mean(axis=1), si.std(axis=1)
    drift = np.abs(si[:, half:].mean(axis=1) - si[:, :half].mean(axis=1))
    reasons = []
    for row, channel in enumerate(channels):
        reason = _objection(channel, mean[row], scatter[row], drift[row], allowed[row])
        if reason:
            reasons.append(f"{channel.id} {reason}")
    reasons += _leaning(rig, mean)
    if reasons:
        raise NotSteady(
            f"The zero cannot be taken: {true_minus('; '.join(reasons))}. The wall must stand upright, "
            "untouched, with every sensor connected"
        )
    # The certificate's offset is subtracted anyway: the tare is what remains.
    beyond = readings.mean(axis=1) - scaling.zero[:, 0]
    return Tare(
        {channel.id: float(value) for channel, value in zip(channels, beyond, strict=True) if channel.zeroed},
        {
            "taken_utc": dt.datetime.now(dt.UTC).isoformat(timespec="seconds"),
            "first_sample": first_sample,
            "n_samples": int(readings.shape[1]),
            "scatter_si": {channel.id: float(s) for channel, s in zip(channels, scatter, strict=True)},
            "drift_si": {channel.id: float(d) for channel, d in zip(channels, drift, strict=True)},
        },
    )


def _objection(channel: Channel, mean: float, scatter: float, drift: float, noise: float) -> str:
    if not np.isfinite([mean, scatter]).all():
        return "gives no numbers"
    if not channel.zeroed:
        return ""
    span = channel.range_si[1] - channel.range_si[0]
    # An auxiliary sensor may stand anywhere in its range: a laser at its distance, a gauge in mid-stroke.
    if not channel.auxiliary and abs(mean) > _LARGEST_SHARE * span:
        return (
            f"reads {mean:.3g} {channel.si_unit}, far from zero (connected? plugged into its own terminal?)"
        )
    if scatter > _NOISE_FACTOR * noise:
        return f"scatters by {scatter:.2g} {channel.si_unit}, expected {noise:.2g}"
    if drift > _DRIFT_FACTOR * noise:
        return f"drifts by {drift:.2g} {channel.si_unit} within the second"
    return ""


def _leaning(rig: Rig, mean: Floats) -> list[str]:
    """Whether the tiltmeters together say that the wall is pulled already.

    Their mean decides: each is mounted a fraction of a degree off, and a pulled wall with one of two
    dead still shows half of its rotation.
    """
    rows = [
        row
        for row, channel in enumerate(rig.channels)
        if channel.family == "tiltmeter" and channel.axis == "x"
    ]
    if not rows or abs(float(mean[rows].mean())) <= _UPRIGHT_SHARE * rig.specimen.alpha0_rad:
        return []
    told = ", ".join(f"{rig.channels[row].id} {mean[row] * 1e3:+.1f}" for row in rows)
    return [f"the tiltmeters show the wall leaning by {mean[rows].mean() * 1e3:+.1f} mrad ({told})"]

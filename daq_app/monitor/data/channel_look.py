"""What is to be known of one channel now: value, volts, noise, spectrum, limits. Knows nothing of Qt."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.acquisition.checks.sensor_check import disturbance
from daq_app.config.rig import Channel, Rig
from daq_app.config.scaling import Scaling
from daq_app.monitor.data.session import RECENT_S, Session

Array = NDArray[np.float64]
LOOK_S: Final = RECENT_S - 1.0
"""How much of the past is looked at: somewhat less than the session keeps, or there would often be none."""
_LEAST_S: Final = 1.0
_NEIGHBOURS: Final = 4


@dataclass(frozen=True, slots=True)
class Quality:
    """Noise and hum of the time that is looked at, SI rms."""

    noise_si: float
    hum_si: float
    drift_si: float


@dataclass(frozen=True, slots=True)
class ChannelLook:
    """One channel's last seconds."""

    channel: Channel
    time_s: Array
    """Seconds before now, shape (n,)."""
    values_si: Array
    """Zeroed readings, shape (n,)."""
    readings: Array
    """What the NI channel returned, in the unit of the reading, shape (n,)."""
    frequency_hz: Array
    density_si: Array
    """Amplitude spectral density, SI/√Hz."""
    quality: Quality


def look_at(session: Session, name: str, tare: Mapping[str, float]) -> ChannelLook | None:
    """The channel `name` over the last seconds; None while there are too few samples without a gap."""
    rig = session.rig
    if rig is None:
        return None
    for duration_s in (LOOK_S, _LEAST_S):
        recent = session.recent(duration_s)
        if recent is not None:
            break
    else:
        return None
    place = rig.channel_ids.index(name)
    channel = rig.channels[place]
    values = recent[place].astype(np.float64)
    readings = Scaling.of([channel], tare).to_readings(values[None, :])[0]
    frequency, density = _spectrum(values, session.rate_hz)
    found = disturbance(values[None, :], session.rate_hz)
    return ChannelLook(
        channel,
        (np.arange(values.size) - values.size + 1) / session.rate_hz,
        values,
        readings,
        frequency,
        density,
        Quality(float(found.noise[0]), float(found.hum[0]), float(found.drift[0])),
    )


def _spectrum(values: Array, rate_hz: float) -> tuple[Array, Array]:
    """(frequency, amplitude spectral density) by Welch's method: Hann windows of a second."""
    size = min(values.size, round(rate_hz))
    window = np.hanning(size)
    starts = range(0, values.size - size + 1, max(1, size // 2))
    scale = 2.0 / (rate_hz * np.sum(window**2))
    pieces = [values[start : start + size] for start in starts]
    power = np.mean([scale * np.abs(np.fft.rfft((p - p.mean()) * window)) ** 2 for p in pieces], axis=0)
    frequency = np.asarray(np.fft.rfftfreq(size, 1.0 / rate_hz)[1:], dtype=np.float64)
    density: Array = np.sqrt(power)[1:]
    return frequency, density


def expected_density_si(channel: Channel, rate_hz: float) -> float:
    """The density of white noise of the expected rms, SI/√Hz."""
    return channel.noise_si / math.sqrt(rate_hz / 2.0)


def neighbours(rig: Rig, name: str) -> list[str]:
    """The channels of the same family that are nearest, the nearest first."""
    own = rig.channel(name)
    others = [channel for channel in rig.of_family(own.family) if channel.id != name]
    others.sort(key=lambda channel: math.dist(channel.position_m, own.position_m))
    return [channel.id for channel in others[:_NEIGHBOURS]]

"""Mains hum: one line near 50 or 60 Hz in many channels, found over the whole record and taken out.

The rotation of a rocking wall has next to nothing there: a jump of the angular velocity by 0.3 rad/s leaves
less than 1 µrad of amplitude at 50 Hz over ten seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.geometry.parabola import vertex
from daq_app.rocking.means import block_means

Floats = NDArray[np.float64]

_BANDS_HZ = ((49.0, 51.0), (59.0, 61.0))
_AROUND_HZ = 6.0
"""The background of a line is the median over this far to both sides."""
_MEAN_HZ = 500.0
"""Rows are averaged to about this rate before they are searched."""
_CLEAR = 8.0
"""A line stands this many times above its background; noise alone reaches 4 in one record of a hundred."""
_NOTABLE_NOISES = 1.0
"""Hum below one rms of a channel's noise is ordinary: it is left where it is."""
_SHORTEST_S = 2.0


MAINS_SHARE: Final = 0.004
"""Largest deviation of the frequency of mains (0.2 Hz: largest steady one of the synchronous area of
continental Europe, Regulation (EU) 2017/1485). Raising it hides sampling rates that are wrong by as much."""
_MAINS_HZ: Final = (50.0, 60.0)


@dataclass(frozen=True)
class Hum:
    """One line: `amplitude` (channels,) complex, of exp(2πi f t) with t from sample 0 of the record."""

    frequency_hz: float
    amplitude: NDArray[np.complex128]

    @property
    def wrong_rate_share(self) -> float:
        """Share by which the sampling rate is told too high, if mains hum here; 0 where mains may do so."""
        off = min((self.frequency_hz / mains - 1.0 for mains in _MAINS_HZ), key=abs)
        return off if abs(off) > MAINS_SHARE else 0.0

    def waves(self, row: int, start: int, stop: int, rate_hz: float) -> Floats:
        """The line in samples start … stop of one channel."""
        turns = 2j * np.pi * self.frequency_hz / rate_hz * np.arange(start, stop)
        return np.asarray((self.amplitude[row] * np.exp(turns)).real)


def find_hum(families: Sequence[Floats], noises: Sequence[float], rate_hz: float) -> Hum | None:
    """The mains line of channels in families (channels, n); None where it is ordinary.

    `noises`: rms of one sample of each channel, in the order of the families. Channels whose line is ordinary
    have amplitude 0.
    """
    size = max(1, round(rate_hz / _MEAN_HZ))
    groups = families[0].shape[1] // size if families else 0
    rate = rate_hz / size
    if not groups or groups < _SHORTEST_S * rate or rate < 2.5 * _BANDS_HZ[-1][1]:
        return None
    noise = np.asarray(noises)[:, None]
    means = np.concatenate([_means(rows, size) for rows in families]) / noise
    window = np.hanning(groups)
    windowed = (means - means.mean(axis=1, keepdims=True)) * window
    length = 1 << int(4 * groups - 1).bit_length()
    # The first look, at a quarter of the cost, shows a line at no less than 0.85 of its height.
    if _clearest(windowed, length // 4, rate)[0] < _CLEAR / 2.0:
        return None
    clearness, line_hz = _clearest(windowed, length, rate)
    if clearness <= _CLEAR:
        return None
    # The mean over `size` samples weakens the line and dates it to the middle of the mean.
    step = line_hz / rate_hz
    weakened = np.sinc(step * size) / np.sinc(step) * np.exp(2j * np.pi * step * (size - 1) / 2.0)
    turning = np.exp(-2j * np.pi * line_hz / rate * np.arange(groups))
    amplitude = 2.0 * (windowed @ turning) / (window.sum() * weakened)
    amplitude = np.where(np.abs(amplitude) > _NOTABLE_NOISES, amplitude, 0.0) * noise[:, 0]
    return Hum(line_hz, amplitude) if np.any(amplitude) else None


def _means(rows: Floats, size: int) -> Floats:
    """(channels, n // size) of rows (channels, n), what is unknown taken for zero."""
    means = block_means(rows, size)
    return means if np.isfinite(means).all() else block_means(np.nan_to_num(rows), size)


def _clearest(windowed: Floats, length: int, rate_hz: float) -> tuple[float, float]:
    """Height of the clearest line of rows (channels, n) above its background, and its frequency in Hz.

    `length`: points of the spectrum, rows filled up with zeros.
    """
    # Only what lies about the lines is looked at.
    first = int((_BANDS_HZ[0][0] - 2.0 * _AROUND_HZ) * length / rate_hz)
    last = int((_BANDS_HZ[-1][1] + 2.0 * _AROUND_HZ) * length / rate_hz)
    spectrum = np.fft.rfft(windowed, length, axis=1)[:, first:last]
    frequency = np.arange(first, last) * rate_hz / length
    power = (np.abs(spectrum) ** 2).max(axis=0)
    lines = []
    for low, high in _BANDS_HZ:
        inside = np.flatnonzero((frequency > low) & (frequency < high))
        around = (frequency > low - _AROUND_HZ) & (frequency < high + _AROUND_HZ)
        around[inside] = False
        top = int(inside[np.argmax(power[inside])])
        clearness = float(np.sqrt(power[top] / max(float(np.median(power[around])), 1e-300)))
        _, beyond, _ = vertex(np.log(power[top - 1 : top + 2] + 1e-300), 1)
        lines.append((clearness, (first + top + beyond) * rate_hz / length))
    return max(lines)

"""Mains hum: one line near 50 or 60 Hz in many channels, found over the whole record and taken out.

The rotation of a rocking wall has next to nothing there: a jump of the angular velocity by 0.3 rad/s leaves
less than 1 µrad of amplitude at 50 Hz over ten seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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


@dataclass(frozen=True)
class Hum:
    """One line: `amplitude` (channels,) complex, of exp(2πi f t) with t from sample 0 of the record."""

    frequency_hz: float
    amplitude: NDArray[np.complex128]

    def waves(self, row: int, start: int, stop: int, rate_hz: float) -> Floats:
        """The line in samples start … stop of one channel."""
        turns = 2j * np.pi * self.frequency_hz / rate_hz * np.arange(start, stop)
        return np.asarray((self.amplitude[row] * np.exp(turns)).real)


def find_hum(rows: Floats, noises: Sequence[float], rate_hz: float) -> Hum | None:
    """The mains line of rows (channels, n) with noises (channels,) of one sample; None where it is ordinary.

    Channels whose line is ordinary have amplitude 0.
    """
    size = max(1, round(rate_hz / _MEAN_HZ))
    groups = rows.shape[1] // size
    rate = rate_hz / size
    if not rows.shape[0] or groups < _SHORTEST_S * rate or rate < 2.5 * _BANDS_HZ[-1][1]:
        return None
    noise = np.asarray(noises)[:, None]
    known = rows if np.isfinite(rows).all() else np.nan_to_num(rows)
    means = known[:, : groups * size].reshape(rows.shape[0], groups, size).mean(axis=2) / noise
    window = np.hanning(groups)
    length = 1 << int(4 * groups - 1).bit_length()
    spectrum = np.fft.rfft((means - means.mean(axis=1, keepdims=True)) * window, length, axis=1)
    # Only what lies about the lines is looked at.
    first = int((_BANDS_HZ[0][0] - 2.0 * _AROUND_HZ) * length / rate)
    last = int((_BANDS_HZ[-1][1] + 2.0 * _AROUND_HZ) * length / rate)
    frequency = np.arange(first, last) * rate / length
    power = (np.abs(spectrum[:, first:last]) ** 2).max(axis=0)
    best: tuple[float, float] | None = None
    for low, high in _BANDS_HZ:
        inside = np.flatnonzero((frequency > low) & (frequency < high))
        around = (frequency > low - _AROUND_HZ) & (frequency < high + _AROUND_HZ)
        around[inside] = False
        top = int(inside[np.argmax(power[inside])])
        clearness = float(np.sqrt(power[top] / max(float(np.median(power[around])), 1e-300)))
        if clearness > _CLEAR and (best is None or clearness > best[0]):
            best = (clearness, (first + top + _vertex(power, top)) * rate / length)
    if best is None:
        return None
    line_hz = best[1]
    # The mean over `size` samples weakens the line and dates it to the middle of the mean.
    step = line_hz / rate_hz
    weakened = np.sinc(step * size) / np.sinc(step) * np.exp(2j * np.pi * step * (size - 1) / 2.0)
    turning = np.exp(-2j * np.pi * line_hz / rate * np.arange(groups)) * window
    amplitude = 2.0 * ((means - means.mean(axis=1, keepdims=True)) @ turning) / (window.sum() * weakened)
    amplitude = np.where(np.abs(amplitude) > _NOTABLE_NOISES, amplitude, 0.0) * noise[:, 0]
    return Hum(line_hz, amplitude) if np.any(amplitude) else None


def _vertex(power: Floats, top: int) -> float:
    """How far the maximum lies beyond `top`, by a parabola through the logarithms of three neighbours."""
    left, middle, right = np.log(power[top - 1 : top + 2] + 1e-300)
    bend = left - 2.0 * middle + right
    return 0.5 * float((left - right) / bend) if bend else 0.0

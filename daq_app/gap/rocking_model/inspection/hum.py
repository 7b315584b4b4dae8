"""Mains hum of one channel: found at rest, followed over the record, and taken out of it.

`daq_app.rocking.families.channels.hum` looks for a line that all channels of a record share, whose size
stays. This module follows what a single channel picks up, between impacts that have some of its frequency
themselves.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.signal import butter, sosfiltfilt, sosfreqz

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.inspection.spikes import AROUND_S
from daq_app.gap.rocking_model.tolerances.inspection import BEYOND_HUM, HUM_SD, USUAL_HUM

MAINS_HZ = (50.0, 60.0)
_SLOW_S = 0.1
"""Means over which a record that is turned back by the mains frequency keeps 0.6 Hz to a per cent."""
_SWELLS_S, _MOST_SWELLS = 1.25, 12
"""Time in which the mains may change, and the number of slow cosines by which they are followed at most."""
_ROUNDS, _HUBER = 4, 2.0
"""Rounds of reweighting, and the residual over the middle one from which less weight is given."""
_LEAST_CALM = 0.3
"""Share of a mean over 0.1 s that must be calm."""


def hum_of(values: FloatArray, rate_hz: float) -> tuple[float, float, FloatArray | None]:
    """(amplitude, its sd, the wave over the record) of the mains frequency, from the rest at the end."""
    count = round(0.6 * rate_hz)
    if np.ptp(values[-count:]) == 0.0:  # between two steps of its converter
        return 0.0, 0.0, None
    rest = values[-count:] - values[-count:].mean()
    seen = {}
    for mains_hz in MAINS_HZ:
        design, inverse = _mains_at_rest(count, rate_hz, mains_hz)
        coefficients = inverse @ rest
        left = float(np.sqrt(np.mean((rest - design @ coefficients) ** 2)))
        seen[mains_hz] = float(np.hypot(*coefficients[:2])), left
    mains_hz = max(seen, key=lambda hz: seen[hz][0])
    amplitude, noise = seen[mains_hz]
    sd = noise * np.sqrt(2.0 / count)
    if amplitude < HUM_SD * sd:
        return 0.0, float(sd), None
    low_pass, kept = _below_mains(rate_hz, mains_hz)
    high = values - sosfiltfilt(low_pass, values)
    # An impact has some of every frequency: its own share, taken for hum, would ring around every impact.
    loud = np.abs(high) > BEYOND_HUM * float(np.hypot(noise, amplitude))
    calm = ~maximum_filter1d(loud, 2 * round(AROUND_S * rate_hz) + 1, mode="constant")
    calm = calm if calm.sum() > count else np.ones_like(calm)
    wave = _mains(high, calm, rate_hz, mains_hz) / kept
    # A little hum is on every long cable. It is taken out, but it is nothing to be explained.
    shown = amplitude if amplitude > USUAL_HUM * noise else 0.0
    return shown, float(sd), wave


def _mains(values: FloatArray, calm: NDArray[np.bool_], rate_hz: float, mains_hz: float) -> FloatArray:
    """The wave near the mains frequency, (n,), that the calm samples of a record show.

    Its frequency is that of most power; its size and phase change over seconds, as those of the mains do.
    Turned back by the nominal frequency, what is left goes round slowly: means over 0.1 s keep it.
    """
    block = round(_SLOW_S * rate_hz)
    count = values.size // block
    phasor = _mains_phasor(values.size, rate_hz, mains_hz)
    used = calm[: count * block].reshape(count, block)
    if not (used.mean(axis=1) > _LEAST_CALM).any():
        used = np.ones_like(used)  # knocks leave no mean that is calm enough: what they hold is noise
    turning = phasor[: count * block].reshape(count, block)
    share = np.maximum(used.mean(axis=1), _LEAST_CALM)
    seen = (values[: count * block].reshape(count, block) * turning * used).mean(axis=1)
    # Over a part of a mean the other half of a real wave, which turns back twice as fast, does not vanish.
    back = (turning**2 * used).mean(axis=1)
    slow = (seen * share - np.conj(seen) * back) / (share**2 - np.abs(back) ** 2)
    time_s: FloatArray = np.asarray(_SLOW_S * (np.arange(count) + 0.5), dtype=np.float64)
    enough = used.mean(axis=1) > _LEAST_CALM
    turn = np.exp(2j * np.pi * _most_power(slow * enough, time_s) * time_s)
    # Slow cosines: at its ends a polynomial follows a single mean, whatever that holds.
    order = min(int(_SLOW_S * enough.sum() / _SWELLS_S), _MOST_SWELLS)
    shapes = np.cos(np.pi * np.outer((np.arange(count) + 0.5) / count, np.arange(order + 1)))
    weights = np.asarray(np.sqrt(share) * enough, dtype=np.float64)
    sizes = _sized(shapes, slow / turn, weights)
    smooth = np.interp(np.arange(values.size) / rate_hz, time_s, (shapes @ sizes) * turn)
    return np.asarray(2.0 * np.real(smooth * np.conj(phasor)), dtype=np.float64)


def _sized(shapes: FloatArray, seen: NDArray[np.complex128], weights: FloatArray) -> NDArray[np.complex128]:
    """Sizes of shapes (k, m) by least squares of what is seen, (k,); `weights`, (k,), are one over its sd.

    Means beside an impact hold some of it: what lies further off than most counts for less (Huber's weights).
    """
    trusted = weights
    for _ in range(_ROUNDS):
        sizes, *_ = np.linalg.lstsq(shapes * trusted[:, None], seen * trusted, rcond=None)
        apart = np.abs(seen - shapes @ sizes) * weights
        bar = _HUBER * float(np.median(apart[weights > 0.0]))
        trusted = weights * np.sqrt(np.minimum(1.0, bar / np.maximum(apart, 1e-300)))
    return np.asarray(sizes, dtype=np.complex128)


def _most_power(slow: NDArray[np.complex128], time_s: FloatArray) -> float:
    """Frequency within 0.6 Hz, Hz, at which a slow complex record, (k,), has most power."""
    best = 0.0
    # A twentieth of a hertz off, a wave is half a turn off after ten seconds: a dozen times finer each time.
    for reach, step in ((0.6, 0.05), (0.05, 0.004), (0.004, 5e-4)):
        offsets = best + np.arange(-reach, reach + 0.5 * step, step)
        power = np.abs(np.exp(-2j * np.pi * np.outer(offsets, time_s)) @ slow)
        best = float(offsets[int(np.argmax(power))])
    return best


@lru_cache(maxsize=4)
def _below_mains(rate_hz: float, mains_hz: float) -> tuple[FloatArray, float]:
    """Sections of a low pass that is run both ways, and the share of the mains that is above it."""
    sections = butter(2, 25.0, fs=rate_hz, output="sos")
    _, response = sosfreqz(sections, [mains_hz], fs=rate_hz)
    return sections, 1.0 - float(np.abs(response[0]) ** 2)


@lru_cache(maxsize=4)
def _mains_phasor(count: int, rate_hz: float, mains_hz: float) -> NDArray[np.complex128]:
    """exp(−2πi f t) of the mains frequency, shape (count,)."""
    return np.asarray(np.exp(-2j * np.pi * mains_hz * np.arange(count) / rate_hz))


@lru_cache(maxsize=4)
def _mains_at_rest(count: int, rate_hz: float, mains_hz: float) -> tuple[FloatArray, FloatArray]:
    """Wave of the mains, offset and slope over `count` samples, (count, 4), and their pseudo-inverse."""
    samples = np.arange(count)
    angle = 2.0 * np.pi * mains_hz / rate_hz * samples
    design = np.array([np.sin(angle), np.cos(angle), np.ones(count), samples / rate_hz]).T
    return design, np.linalg.pinv(design)

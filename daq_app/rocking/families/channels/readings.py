"""What the readings of one channel say of its electronics: noise, standstill, leaps, coarse steps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.families.channels.coarse_steps import coarse_step, resolution

Floats = NDArray[np.float64]

_LEAP_NOISES: Final = 6.0
"""A second difference of this many times that of the channel's noise is none of noise: of a million of them
not one. Raising it overlooks short drop-outs of noisy channels."""
_FASTEST_M_S: Final = 2.0
"""Speed, m/s, that no impact gives or takes at a sensor (assumed; 1 rad/s at 2 m). Raising it overlooks
drop-outs in slow motion."""
_STANDS_OUT: Final = 10.0
"""Largest change from sample to sample over the median one, from which steps are looked for: noise reaches
7. Raising it overlooks steps of a few noises."""
_EVERY: Final = 8
"""Medians are taken over every eighth sample: of 40 000 that is as good as over all, in an eighth of the
time."""
_BLOCK_S: Final = 0.05
"""Noise is compared between blocks of this length: what is shorter bends no half-cycle by itself."""
_STILL: Final = 0.3
"""Noise of a block over that of most blocks below which the reading stands still: of 25 samples chance leaves
half. Raising it takes quiet moments for a standstill."""
_OWN_NOISE: Final = 0.3
"""Noise over the rig file's from which a standstill can be told by its absence: a filter takes more away, and
leaves a smooth reading that moves. Raising it overlooks sensors that stand still in quiet laboratories."""
_ABOVE_CONVERTER: Final = 4.0
"""Noise (second differences) over the converter's step from which a sensor that works is never quiet. Raising
it overlooks sensors that stand still behind a coarse converter; lowering it takes quiet sensors for still."""
_AT_STOP: Final = 0.03
"""Share of the range next to its ends in which a reading may stand still: the rig file says that it ends
there. Raising it overlooks sensors that stop just before."""
_MOST: Final = 0.75
"""Share of the blocks whose noise is below that of the channel: of a sensor that stands still for half of the
record it is still the noise of the rest."""
_FEWEST_BLOCKS: Final = 10
_MAD: Final = 1.4826
"""Standard deviation over the median size of a normal error."""


@dataclass(frozen=True, slots=True)
class Readings:
    """One channel, over the whole record."""

    noise_si: float
    """Rms white noise of one sample, in the channel's unit; NaN where it has too few."""
    still: NDArray[np.bool_]
    """(blocks,): where it stands still, without even its noise, away from the ends of its range."""
    block_s: float
    """Length of a block."""
    leaps: int
    """Times that it goes further within one sample than noise or a wall do."""
    step_si: float
    """Step of a reading that only takes values a step apart; 0 where it does not."""


def readings_of(values: Floats, rate_hz: float, noise_si: float, range_si: tuple[float, float]) -> Readings:
    """What the readings (n,) of an LVDT or a wire, m, show; NaN where there is none.

    `noise_si`: the declared rms noise of one sample, m. `range_si`: its range, m, less the zero that the
    readings are without.
    """
    size = max(_EVERY, round(_BLOCK_S * rate_hz))
    second = np.abs(np.diff(values, 2))
    blocks = second[: second.size // size * size].reshape(-1, size)[:, ::_EVERY]
    noises = np.median(blocks, axis=1)
    known = np.isfinite(noises)
    if np.count_nonzero(known) < _FEWEST_BLOCKS:
        return Readings(math.nan, np.zeros(0, dtype=bool), size / rate_hz, 0, 0.0)
    scale = _MAD * float(np.quantile(noises[known], _MOST))
    # Where play or a filter hides the noise, that of the rig file counts.
    usual = max(scale, math.sqrt(6.0) * noise_si)
    limit = max(_LEAP_NOISES * usual, _FASTEST_M_S / rate_hz)
    far = np.flatnonzero(second > limit)
    leaps = 0 if not far.size else 1 + int(np.count_nonzero(np.diff(far) > 2))
    still = known & (_MAD * noises < _STILL * scale)
    shows_noise = scale > _OWN_NOISE * math.sqrt(6.0) * noise_si
    if still.any() and shows_noise and scale > _ABOVE_CONVERTER * resolution(values[np.isfinite(values)]):
        low, high = range_si
        shown = values[: noises.size * size : size]
        margin = _AT_STOP * (high - low)
        still &= (shown > low + margin) & (shown < high - margin)
    else:
        still[:] = False
    # A second difference has six times the variance of a sample.
    return Readings(scale / math.sqrt(6.0), still, size / rate_hz, leaps, _step(values, noise_si))


def _step(values: Floats, noise_si: float) -> float:
    change = np.abs(np.diff(values))
    change = change[np.isfinite(change)]
    if float(change.max()) <= _STANDS_OUT * float(np.median(change[::_EVERY])):
        return 0.0
    return coarse_step(values[np.isfinite(values)], noise_si)

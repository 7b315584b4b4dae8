"""Readings that only take values a step apart: a wire-wound potentiometer, a digital sensor, few bits."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_A_STEP: Final = 0.4
"""Share of the largest changes from sample to sample, 1, from which one is a step or some (assumed).
Raising it takes single steps for noise where readings go on by several at once."""
_BESIDE_STEPS: Final = 0.05
"""Rms of the other changes over a step, 1, up to which a reading stands still between steps (assumed).
Raising it takes noise for steps."""
_OF_CONVERTER: Final = 0.15
"""Step of the converter over a coarser one of the reading, 1, up to which both are told apart (assumed).
Raising it takes noise for steps."""
_OFF_STEP: Final = 0.15
"""Distance from a whole number of steps, 1, up to which a change is one (assumed). Raising it takes noise
for steps."""
_IN_STEPS: Final = 0.9
"""Share of the large changes, 1, that must be whole numbers of steps (assumed). Raising it overlooks steps
in readings with spikes."""
_FEWEST_STEPS: Final = 0.004
"""Share of samples, 1, at which a reading in steps goes on by a step at least. Raising it overlooks steps
that are so coarse that the reading seldom goes on."""
_SMALLEST_STEP: Final = 5e-4
"""Step over the span of the reading, 1, from which it matters: below, it is the converter's own. Raising it
overlooks fine steps."""
_CONVERTER_STEP: Final = 3.0
"""Step over the declared noise of a reading, 1, up to which it is the converter's own (assumed). Raising it
overlooks fine steps."""


def coarse_step(values: Floats, noise_si: float) -> float:
    """Step of a reading (n,) that only takes values a step apart, in its unit; 0 where it does not.

    From sample to sample such a reading stays, or goes on by whole steps; noise does neither. `noise_si`: the
    declared rms noise of one sample.
    """
    change = np.abs(np.diff(values))
    top = _quantile(change, 0.9995)
    large = change > _A_STEP * top
    if top <= 0.0 or np.mean(large) < _FEWEST_STEPS:
        return 0.0
    rest = float(np.sqrt(np.mean(change[~large] ** 2)))
    if rest > _OF_CONVERTER * top:  # their median is smaller still, and takes longer to find
        return 0.0
    step = float(np.median(change[large]))
    whole = change[large] / step
    # Between two steps of its own the converter goes to and fro.
    own = resolution(values) if rest > _BESIDE_STEPS * step else 0.0
    beside = own if own < _OF_CONVERTER * step else 0.0
    if (
        rest > max(_BESIDE_STEPS * step, beside)
        or np.mean(np.abs(whole - np.round(whole)) < _OFF_STEP) < _IN_STEPS
    ):
        return 0.0
    none = step < _CONVERTER_STEP * noise_si or step < _SMALLEST_STEP * float(np.ptp(values))
    return 0.0 if none else step  # the converter's own step is none


def resolution(values: Floats) -> float:
    """Step of the converter behind a reading (n,): the least that it changes by; 0 where it never changes."""
    change = np.abs(np.diff(values))
    change = change[change > 0.0]
    return _quantile(change, 0.01) if change.size > 1 else 0.0


def _quantile(values: Floats, share: float) -> float:
    """As `np.quantile`, in a tenth of its time for one share of a long row."""
    at = share * (values.size - 1)
    low = int(at)
    high = min(low + 1, values.size - 1)
    ordered = np.partition(values, (low, high))
    return float(ordered[low] + (at - low) * (ordered[high] - ordered[low]))

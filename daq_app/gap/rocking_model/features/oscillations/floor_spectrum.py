"""How much the floor vibrates at every frequency, where it does so irregularly: traffic, machines, wind.

All accelerometers have the floor in common and their noise each for itself. The cross-spectrum of two halves
of them, while the wall is held and after it rests, is therefore that of the floor alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.oscillations.floor_vibration import (
    QuietRecord,
    quiet_record,
    sinusoids,
)
from daq_app.gap.rocking_model.features.oscillations.rings import Ring
from daq_app.gap.rocking_model.features.oscillations.vibration import FloorSpectrum
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.walls import (
    FEWEST_PARTS,
    FLOOR_RMS_M_S2,
    FLOOR_STANDS_OUT,
    LEAST_KEPT,
)

_BANDS_HZ = np.arange(0.5, 13.0, 0.5)
"""Ends of the bands. Slower ones show in no part at rest; what is faster turns a wall by less than noise."""
_MIDDLES_HZ = 0.5 * (_BANDS_HZ[1:] + _BANDS_HZ[:-1])
_PART = 200
"""Samples of the grid in a part, 1 s: longer rests are cut."""
_SHORTEST = 100
"""Samples of a part that is used: a shorter one tells no frequency."""


def floor_spectrum(runs: Sequence[GapRun], grids: Sequence[Grid], ring: Ring | None) -> FloorSpectrum | None:
    """The floor of all runs together; None where it does not stand out of noise, or can hardly be felt.

    `ring` is the wall's own ring-down after impacts.
    """
    parts = [part for run, grid in zip(runs, grids, strict=True) for part in _parts(run, grid, ring)]
    if len(parts) < FEWEST_PARTS:
        return None
    weights = np.array([samples for samples, _ in parts], dtype=float)
    weights /= weights.sum()
    powers = np.array([power for _, power in parts])
    total = powers.sum(axis=1)
    mean = float(weights @ total)
    sd = float(np.sqrt(np.sum((weights * (total - mean)) ** 2)))
    if mean < max(FLOOR_RMS_M_S2**2, FLOOR_STANDS_OUT * sd):
        return None
    bands = np.sqrt(np.maximum(weights @ powers, 0.0))
    return FloorSpectrum(_MIDDLES_HZ, bands, 0.5 * sd / float(np.sqrt(mean)))


def _parts(run: GapRun, grid: Grid, ring: Ring | None) -> list[tuple[int, FloatArray]]:
    """(samples, cross-power in every band, (m/s²)²) of each part at rest of a run."""
    record = quiet_record(run, grid, ring)
    if record is None or len(record.each) < 2:
        return []
    kept = _kept(record)
    gaps = np.flatnonzero(np.diff(record.time_s) > 1.5 / GRID_HZ) + 1
    one, other = (_pieces(record.each[start::2].mean(axis=0), gaps) for start in (0, 1))
    pairs = zip(one, other, strict=True)
    return [(a.size, _cross_power(a, b) / kept) for a, b in pairs if a.size >= _SHORTEST]


def _kept(record: QuietRecord) -> FloatArray:
    """Share of each band's power that is left where sway and offsets are taken out, (k,)."""
    waves = sinusoids(_MIDDLES_HZ, record.time_s)
    taken = np.sum((waves @ record.basis) ** 2, axis=(1, 2)) / np.sum(waves**2, axis=(1, 2))
    return np.asarray(np.maximum(1.0 - taken, LEAST_KEPT))


def _pieces(values: FloatArray, gaps: NDArray[np.intp]) -> list[FloatArray]:
    """What lies between gaps, cut to one or two seconds."""
    return [
        piece
        for whole in np.split(values, gaps)
        for piece in np.array_split(whole, max(whole.size // _PART, 1))
    ]


def _cross_power(one: FloatArray, other: FloatArray) -> FloatArray:
    """What two records (n,) have in common, as mean squares by bands."""
    window = np.hanning(one.size)
    window /= np.sqrt(np.mean(window**2))
    a, b = (np.fft.rfft(values * window) for values in (one, other))
    power = 2.0 * np.real(a * np.conj(b)) / one.size**2
    frequency = np.fft.rfftfreq(one.size, 1.0 / GRID_HZ)
    return np.array(
        [power[(frequency >= low) & (frequency < high)].sum() for low, high in pairwise(_BANDS_HZ)]
    )

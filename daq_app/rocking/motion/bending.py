"""A wall that bends: wires high on it ring with it, the LVDTs at its base do not.

Every impact sets a bending wall ringing about the chord that its rotation is taken for. Wires less LVDTs are
then an oscillation of one frequency, which neither the motion of a rigid wall, whose half-cycles grow ever
shorter, nor an instrument that is slow, late, drifts or has a wrong gain can leave between two families.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_RATE_HZ: Final = 500.0
_LOWEST_HZ: Final = 1.5
_HIGHEST_HZ: Final = 36.0
"""Modes are looked for up to here, so that the band of the fastest ends below the mains; faster ones move no
half-cycle."""
_PERIODS: Final = 10.0
"""Periods that what is compared must hold: the window's main lobe is then within the band of the mode."""
_BAND: Final = (0.8, 1.25)
"""The mode's band, as shares of its frequency: kicks and damping widen its line."""
_SLOWEST_HZ: Final = 0.3
"""Slower differences are of zeros that walk."""
_SHARE: Final = 0.5
"""Share of the difference's power in one band that is named: sound laboratories and the other faults and
walls of the library leave less than 0.4. Raising it lets wires lead whose ringing moves r by 0.03."""
_KNOWN: Final = 0.98
"""Share of what is compared that both families must know."""
_SMOOTH_DEGREE: Final = 4
"""A half-cycle of a second differs from such a polynomial by some µrad."""
_LAST_S: Final = 0.5


@dataclass(frozen=True, slots=True)
class Bending:
    """How the rotation from the wires rings about that from the LVDTs."""

    frequency_hz: float
    rms_rad: float
    """Over the motion."""
    last_rad: float
    """The same over its last half second: by this a zero is off that is taken while the wall stands bent."""


def find_bending(
    time_s: Floats, wires_rad: Floats, lvdts_rad: Floats, impacts_s: Sequence[float]
) -> Bending | None:
    """The ringing of wires (n,) about LVDTs (n,) on one time base; None where nothing rings, or the LVDTs."""
    rate = (time_s.size - 1) / (time_s[-1] - time_s[0]) if time_s.size > 1 else 0.0
    size = max(1, round(rate / _RATE_HZ))
    groups = time_s.size // size
    both = np.stack([values[: groups * size].reshape(groups, size) for values in (wires_rad, lvdts_rad)])
    means = both.mean(axis=2)
    known = np.isfinite(means).all(axis=0)
    lowest = max(_LOWEST_HZ, _PERIODS * rate / max(groups * size, 1))
    if lowest >= _HIGHEST_HZ or known.mean() < _KNOWN or len(impacts_s) < 2:
        return None
    places = np.arange(groups, dtype=np.float64)
    wires, lvdts = (np.interp(places, places[known], row[known]) for row in means)
    table = np.column_stack([lvdts, np.ones(groups), places - places.mean()])
    left = wires - table @ np.linalg.lstsq(table, wires, rcond=None)[0]
    frequency = np.arange(groups // 2 + 1) * rate / (size * groups)
    looked = (frequency >= lowest) & (frequency <= _HIGHEST_HZ)
    spectrum = np.abs(np.fft.rfft(left * np.hanning(groups))) ** 2
    mode_hz = float(frequency[looked][np.argmax(spectrum[looked])])
    band = (frequency > _BAND[0] * mode_hz) & (frequency < _BAND[1] * mode_hz)
    if spectrum[band].sum() < _SHARE * spectrum[frequency > _SLOWEST_HZ].sum():
        return None
    first = slice(*np.searchsorted(time_s[::size][:groups], impacts_s[:2]))
    if _roughness(wires[first]) < _roughness(lvdts[first]):
        return None
    last = left[-max(1, round(_LAST_S * rate / size)) :]
    return Bending(mode_hz, float(left.std()), float(np.sqrt(np.mean(last**2))))


def _roughness(half_cycle_rad: Floats) -> float:
    """Sum of squares about a polynomial, which the smooth motion of a rigid wall between impacts is."""
    if half_cycle_rad.size <= _SMOOTH_DEGREE:
        return 0.0
    x = np.linspace(-1.0, 1.0, half_cycle_rad.size)
    smooth = np.polynomial.Polynomial.fit(x, half_cycle_rad, _SMOOTH_DEGREE)
    return float(np.sum((half_cycle_rad - smooth(x)) ** 2))

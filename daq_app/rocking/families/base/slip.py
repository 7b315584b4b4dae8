"""A base that friction does not hold: it slips between impacts, while the wall is nearly upright.

The wires tell how far the base moves along x, and turns about the vertical, from just after an impact to just
before the next one. The rotation is as small there as here, so that no calibration matters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.theory.friction import push, slips_below

Floats = NDArray[np.float64]

_BELOW: Final = np.geomspace(0.01, 0.4, 16)
"""Rotations below which a base may slip, over α."""
_FEWEST: Final = 7
"""Half-cycles that tell a law: three more than it has coefficients."""
_NOISE: Final = 2e-5
"""What slips and turns are known to at best, m or rad: few half-cycles may agree by chance."""
_SURE_SD: Final = 10.0
"""Standard errors from none from which a base slips: sound laboratories reach 4, walls on springs 7. Raising
it hides slips."""
_EXPLAINED: Final = 0.5
"""Share of what half-cycles differ by that the law explains where a base slips: it is 0.9 of slips, 0.3 at
most of what rings or springs back. Raising it hides slips under noise."""
_FASTEST: Final = 6.0
"""Acceleration of a slip for each rad over p² R: a rectangular block that slips on all of its base has four,
I_O over I_G. Raising it takes slow wires for slips."""
_TURNS_ABOUT_M: Final = 3.0
"""Distance of the place that a base turns about where friction fails at one end of it: longer than walls are.
Raising it says of bases that slip along their whole length that they turn."""


@dataclass(frozen=True, slots=True)
class HalfCycleSlips:
    """What half-cycles show of the base between their two impacts, (k,) each."""

    side: Floats
    """Of the edge that the wall is on, ±1."""
    peak_rad: Floats
    """Without sign."""
    speed_rad_s: Floats
    """Of the impact before, without sign."""
    along_m: Floats
    """How far it slips outwards, towards the side."""
    turn_rad: Floats
    """How far it turns, positive where the end at y > 0 moves outwards."""

    @classmethod
    def joined(cls, parts: Sequence[HalfCycleSlips]) -> HalfCycleSlips:
        """Those of several tests of a wall."""
        names = ("side", "peak_rad", "speed_rad_s", "along_m", "turn_rad")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


@dataclass(frozen=True, slots=True)
class BaseSlip:
    """A base that slips outwards below a rotation, and turns about the vertical with that.

    Each pair is of a wall on its edge at x < 0, and on that at x > 0.
    """

    below_rad: float
    friction: float
    """Coefficient of friction that holds it beyond, 1."""
    along: Floats
    """(2,) acceleration outwards for each rad below it, m/s²."""
    turning: Floats
    """(2,) the same of the turn, rad/s²."""
    slip_m: float
    """Largest slip between two impacts."""
    slip_sd_m: float
    turn_rad: float
    """Largest turn between two impacts."""
    turn_sd_rad: float

    @property
    def turns(self) -> bool:
        """Whether one end of the wall slips further than the other."""
        return float(np.abs(self.turning).max()) * _TURNS_ABOUT_M > float(np.abs(self.along).max())


def find_slip(seen: HalfCycleSlips, alpha_rad: float, p_rad_s: float, r0_m: float) -> BaseSlip | None:
    """The slip by the law of friction; None where half-cycles show none, or are too few to tell."""
    if seen.side.size < _FEWEST:
        return None
    most = _FASTEST * p_rad_s**2 * r0_m
    best: tuple[float, float, _Fitted, _Fitted] | None = None
    gain = 0.0
    for below in (_BELOW * alpha_rad).tolist():
        law = slips_below(below, seen.peak_rad, alpha_rad, p_rad_s).slip
        along, turn = (_fitted(law, seen, series) for series in (seen.along_m, seen.turn_rad))
        gained = along.sure**2 + turn.sure**2
        # A wire at fault turns the base about nothing; slow wires would have it slip faster than it can.
        if gained > gain and along.stands_out and 0.0 < along.sizes[along.place] < most:
            best, gain = (below, float(law.max()), along, turn), gained
    if best is None:
        return None
    below, largest, along, turn = best
    sizes = (largest * size for fit in (along, turn) for size in fit.largest)
    return BaseSlip(below, push(below, alpha_rad, p_rad_s, r0_m), along.sizes, turn.sizes, *sizes)


@dataclass(frozen=True, slots=True)
class _Fitted:
    """Accelerations by which a series follows the law, (2,): at x < 0 and at x > 0."""

    sizes: Floats
    sd: Floats
    explained: float
    """Share of what half-cycles differ by."""
    share: float
    """Of all that they show, without what goes with the speed or is the same in all: what slow wires do."""

    @property
    def place(self) -> int:
        """Of the side that is surer."""
        return int(np.argmax(np.abs(self.sizes / self.sd)))

    @property
    def sure(self) -> float:
        """Standard errors from none, of that side."""
        return abs(float(self.sizes[self.place] / self.sd[self.place]))

    @property
    def stands_out(self) -> bool:
        return self.sure > _SURE_SD and min(self.explained, self.share) > _EXPLAINED

    @property
    def largest(self) -> tuple[float, float]:
        """The larger acceleration, without sign, and its standard error."""
        place = int(np.argmax(np.abs(self.sizes)))
        return abs(float(self.sizes[place])), float(self.sd[place])


def _fitted(law: Floats, seen: HalfCycleSlips, series: Floats) -> _Fitted:
    """`series` (k,) by the law, beside a delay of wires, which grows with the speed, and play."""
    others = np.column_stack([np.ones_like(series), seen.speed_rad_s])
    design = np.column_stack([law * (seen.side < 0.0), law * (seen.side > 0.0), others])
    left = series - design @ np.linalg.lstsq(design, series, rcond=None)[0]
    without = series - others @ np.linalg.lstsq(others, series, rcond=None)[0]
    few = math.sqrt(series.size / (series.size - design.shape[1]))
    noise = max(1.48 * few * float(np.median(np.abs(left))), _NOISE)
    inverse = np.linalg.pinv(design.T @ design)
    sd = noise * np.sqrt(np.maximum(np.diag(inverse)[:2], 1e-30))
    explained = 1.0 - float(left @ left) / max(float(without @ without), 1e-30)
    sizes = (inverse @ design.T @ series)[:2]
    by_law = design[:, :2] @ sizes
    share = float(by_law @ by_law) / max(float(series @ series), 1e-30)
    return _Fitted(sizes, sd, explained, share)

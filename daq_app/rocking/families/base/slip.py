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
"""Rotations, over α, that are tried as the one below which a base slips."""
_FEWEST: Final = 7
"""Number of half-cycles from which the law is fitted: three more than it has coefficients."""
_NOISE: Final = 2e-5
"""Least error of a slip (m) or turn (rad): few half-cycles may agree better than that by chance."""
_SURE_SD: Final = 10.0
"""Number of standard errors from which a slip is no chance: sound laboratories reach 4, walls on springs 7.
Raising it hides slips."""
_EXPLAINED: Final = 0.5
"""Least share of the half-cycles' differences that the law must explain: it explains 0.9 of slips, and 0.3 at
most of what rings or springs back. Raising it hides slips under noise."""
_FASTEST: Final = 6.0
"""Largest acceleration of a slip for each rad, over p² R: a rectangular block that slips on all of its base
has four, which is I_O over I_G. Raising it takes slow wires for slips."""
_SLOWEST: Final = 0.5
"""Least acceleration of a slip for each rad, over p² R: an eighth of that which such a block has. Raising it
misses bases of which only one end slips, lowering it takes wires that drift for slips."""
_TURNS_ABOUT_M: Final = 3.0
"""Largest distance of the place that a base turns about where friction fails at one end: walls are shorter.
Raising it says of bases that slip along their whole length that they turn."""


@dataclass(frozen=True, slots=True)
class HalfCycleSlips:
    """What half-cycles show of the base between their two impacts, (k,) each."""

    side: Floats
    """The edge that the wall is on: −1 is the one at x < 0, 1 the one at x > 0."""
    peak_rad: Floats
    """Largest rotation of the half-cycle, without sign."""
    speed_rad_s: Floats
    """Speed with which the wall comes to the impact that begins the half-cycle, without sign."""
    along_m: Floats
    """How far the base slips outwards, towards the edge that the wall is on."""
    turn_rad: Floats
    """How far the base turns about the vertical, positive where its end at y > 0 moves outwards."""

    @classmethod
    def joined(cls, parts: Sequence[HalfCycleSlips]) -> HalfCycleSlips:
        """The half-cycles of several tests of a wall, one test after the other."""
        names = ("side", "peak_rad", "speed_rad_s", "along_m", "turn_rad")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


@dataclass(frozen=True, slots=True)
class BaseSlip:
    """A base that slips outwards below a rotation, and turns about the vertical with that.

    The first number of each pair holds while the wall is on its edge at x < 0, the second on that at x > 0.
    """

    below_rad: float
    friction: float
    """Coefficient of friction that holds it beyond, 1."""
    along: Floats
    """(2,) acceleration outwards for each rad below it, m/s²."""
    turning: Floats
    """(2,) angular acceleration about the vertical for each rad below it, 1/s²."""
    slip_m: float
    """Largest slip between two impacts."""
    slip_sd_m: float
    turn_rad: float
    """Largest turn between two impacts."""
    turn_sd_rad: float
    begins_s2: float = 0.0
    """Speed with which an impact leaves it, over that of the impact and over the acceleration, s²; 0 where
    half-cycles alone are known, which do not tell it."""

    @property
    def turns(self) -> bool:
        """Whether one end of the wall slips further than the other."""
        return float(np.abs(self.turning).max()) * _TURNS_ABOUT_M > float(np.abs(self.along).max())


def find_slip(seen: HalfCycleSlips, alpha_rad: float, p_rad_s: float, r0_m: float) -> BaseSlip | None:
    """The slip by the law of friction; None where half-cycles show none, or are too few to tell."""
    if seen.side.size < _FEWEST:
        return None
    least, most = (share * p_rad_s**2 * r0_m for share in (_SLOWEST, _FASTEST))
    best: tuple[float, float, _Fitted, _Fitted] | None = None
    gain = 0.0
    for below in (_BELOW * alpha_rad).tolist():
        law = slips_below(below, seen.peak_rad, alpha_rad, p_rad_s).slip
        along, turn = (_fitted(law, seen, series) for series in (seen.along_m, seen.turn_rad))
        gained = along.sure**2 + turn.sure**2
        # A wire at fault turns the base about nothing; slow wires would have it slip faster than it can.
        if gained > gain and along.stands_out and least < along.sizes[along.place] < most:
            best, gain = (below, float(law.max()), along, turn), gained
    if best is None:
        return None
    below, largest, along, turn = best
    sizes = (largest * size for fit in (along, turn) for size in fit.largest)
    return BaseSlip(below, push(below, alpha_rad, p_rad_s, r0_m), along.sizes, turn.sizes, *sizes)


@dataclass(frozen=True, slots=True)
class _Fitted:
    """Accelerations by which a series follows the law: on the edge at x < 0, and on that at x > 0."""

    sizes: Floats
    """(2,) accelerations for each rad."""
    sd: Floats
    """(2,) their standard errors."""
    explained: float
    """Share that the law explains of what a delay and play of the wires leave."""
    share: float
    """Share that the law has in the whole series; slow wires put nearly all of it into the delay."""

    @property
    def place(self) -> int:
        """Index of the edge whose acceleration is more standard errors from none."""
        return int(np.argmax(np.abs(self.sizes / self.sd)))

    @property
    def sure(self) -> float:
        """Number of standard errors by which the acceleration of that edge is from none."""
        return abs(float(self.sizes[self.place] / self.sd[self.place]))

    @property
    def stands_out(self) -> bool:
        """Whether the series follows the law, and not by chance."""
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

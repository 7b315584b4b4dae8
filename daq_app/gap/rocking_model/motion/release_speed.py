"""How fast did the wall move when it was let go? Away from upright or back: what the fall alone cannot tell.

A wall thrown up falls through its held rotation as fast as it left it. The times of the fall therefore
know the size of the speed at the release and not its sign; the
hundredth parts of a second around the release know both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.motion.held_state import HeldState
from daq_app.gap.rocking_model.motion.swings import Swings
from daq_app.gap.rocking_model.records import Survey
from daq_app.gap.rocking_model.tolerances.walls import RELEASE_SPEED_RAD_S

BEFORE_S, AFTER_S = 0.06, 0.10
SEARCHED_S = 0.05
_STEPS = 41
_WORK_HZ = 1000.0
_PROFILED = 401
_SPEEDS_RAD_S = np.linspace(-0.08, 0.08, 321)


def release_speed(
    theta: FloatArray, noise_rad: float, swings: Swings, survey: Survey, rate_hz: float
) -> tuple[float, float] | None:
    """(speed away from upright in rad/s, its sd) at the release; None where the record is too short.

    Least squares of θ₀ + v sinh(pτ)/p − a (cosh(pτ) − 1)/p², τ the time since a release that is sought
    too: the motion of the linearised block, which sways as it is held until then.
    """
    step = max(round(rate_hz / _WORK_HZ), 1)
    first = round((swings.release_s - BEFORE_S - SEARCHED_S) * rate_hz)
    last = round((swings.release_s + AFTER_S) * rate_hz)
    if first < 0 or last > theta.size:
        return None
    count = (last - first) // step
    side = float(np.sign(swings.peak_rad[0]))
    seen = side * theta[first : first + count * step].reshape(count, step).mean(axis=1)
    time_s = (first + step * (np.arange(count, dtype=np.float64) + 0.5) - 0.5) / rate_hz - swings.release_s
    starts: FloatArray = np.linspace(-SEARCHED_S, SEARCHED_S, _STEPS, dtype=np.float64)
    held = swings.held
    fits = _Fits.of(seen, time_s, starts, survey.p_rad_s, held, side)
    for _ in range(4):
        width = starts[1] - starts[0]
        starts = starts[fits.best] + np.linspace(-width, width, 9, dtype=np.float64)
        fits = _Fits.of(seen, time_s, starts, survey.p_rad_s, held, side)
    left = float(fits.left[fits.best])
    _, curvature, speed = np.linalg.solve(fits.triangle[fits.best], fits.along[fits.best]).tolist()
    variance = max(left / max(count - 4, 1), noise_rad**2 / step)
    profiled = np.linspace(-SEARCHED_S, SEARCHED_S, _PROFILED, dtype=np.float64)
    told = _told(_Fits.of(seen, time_s, profiled, survey.p_rad_s, held, side), speed, variance)
    # Thrown up the wall rises v²/2a above its hold; what the hold is known to is as good as that.
    rise = 2.0 * abs(curvature) * held.rotation_sd
    swayed = 2.0 * (float(np.hypot(speed, np.sqrt(rise))) - abs(speed))
    return speed, float(np.linalg.norm([told, swayed, RELEASE_SPEED_RAD_S]))


@dataclass(frozen=True, slots=True)
class _Fits:
    """Fits with the release at each of k starts, by the triangle of 1, −(cosh pτ − 1)/p², sinh(pτ)/p."""

    triangle: FloatArray
    """(k, 3, 3)"""
    along: FloatArray
    """(k, 3) what is seen, along the orthonormal basis of the shapes."""
    left: FloatArray
    """(k,) squares that are left."""

    @classmethod
    def of(
        cls,
        seen: FloatArray,
        time_s: FloatArray,
        starts_s: FloatArray,
        p: float,
        held: HeldState,
        side: float,
    ) -> _Fits:
        """Fits of a rotation (n,) at times (n,) from the release, folded to the side it is released on."""
        since = p * np.maximum(time_s - starts_s[:, None], 0.0)
        beyond = seen - side * held.course(np.minimum(time_s, starts_s[:, None]))
        shapes = (np.ones_like(since), -(np.cosh(since) - 1.0) / p**2, np.sinh(since) / p)
        basis, triangle = np.linalg.qr(np.stack(shapes, axis=-1))
        along = (beyond[:, None, :] @ basis)[:, 0, :]
        left = beyond - (basis @ along[:, :, None])[:, :, 0]
        return cls(triangle, along, np.sum(left**2, axis=1))

    @property
    def best(self) -> int:
        return int(np.argmin(self.left))


def _told(fits: _Fits, speed: float, variance: float) -> float:
    """Sd of the speed, from its likelihood with every other unknown at its best.

    What is seen is how far the motion turns above the hold, v²/2a, which says little of a small v and of
    its sign: the curvature at the best speed would promise too much. The sd is that at which no speed
    at all is as unlikely as it is; where it is likely, how far off others are that are not.
    """
    # The speed's shape comes last: what the others leave is a parabola in the speed.
    off = fits.along[:, 2:] - fits.triangle[:, 2, 2:] * _SPEEDS_RAD_S
    lost = np.min(fits.left[:, None] + off**2, axis=0)
    squares = (lost - lost.min()) / variance
    against_none = float(squares[_SPEEDS_RAD_S.size // 2])
    if against_none > 1.0:
        return abs(speed) / float(np.sqrt(against_none))
    apart = np.abs(_SPEEDS_RAD_S - speed)
    return float(np.min(apart, where=squares >= 1.0, initial=apart.max()))

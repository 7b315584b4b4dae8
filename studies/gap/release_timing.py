"""How well the instant is known at which a wall that sways is let go.

    python -m studies.gap.release_timing

Draws holds that sway by two harmonics of 0.4 to 3 Hz, the second half as large, and Housner's fall from
where they are and as fast as they move, or thrown up besides. Prints by how much the release is off, and
the top of a parabola through the fall by a twentieth to three tenths, as a table.
"""

from __future__ import annotations

import itertools
import sys
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import butter, sosfiltfilt

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.motion.release import release_sample
from studies.gap.held_state import HELD_RAD, LET_GO_S, RATE_HZ, swaying

P_RAD_S = 2.1
NOISE_RAD = 3e-5
_SMOOTH_HZ = 30.0
_FALL_S = 1.5
_DRAWS = 60
_ALPHAS_RAD = (0.2, 0.09)
_SHARES = (3e-4, 1e-3, 3e-3, 1e-2)
"""Amplitude of the first harmonic over the held rotation."""
_THROWN_RAD_S = (0.01, 0.02, 0.04)
"""Speeds away from upright of walls that are thrown up."""


def let_go(rng: np.random.Generator, share: float, alpha_rad: float, thrown_rad_s: float = 0.0) -> FloatArray:
    """A record, (n,), rad, without its fast noise, of a wall that is let go at `LET_GO_S` while it sways.

    `thrown_rad_s` is the speed away from upright that it is given there beside that of its sway.
    """
    held, rotation, speed = swaying(rng, share * HELD_RAD, 0.0)
    after_s = np.arange(0.0, _FALL_S, 1.0 / RATE_HZ)
    rates = partial(_falls, alpha_rad=alpha_rad)
    fall = solve_ivp(rates, (0.0, _FALL_S), [rotation, speed + thrown_rad_s], t_eval=after_s, rtol=1e-9).y[0]
    record = np.concatenate(
        [held[: round(LET_GO_S * RATE_HZ)], fall[: int(np.argmax(fall < -0.2 * HELD_RAD))]]
    )
    noisy = record + NOISE_RAD * rng.standard_normal(record.size)
    return np.asarray(sosfiltfilt(butter(4, _SMOOTH_HZ, fs=RATE_HZ, output="sos"), noisy))


def late_s(smooth: FloatArray) -> float:
    """By how much the release is found too late in such a record."""
    upright = int(np.argmax(smooth < 0.0))
    return release_sample(smooth, NOISE_RAD, upright, P_RAD_S, RATE_HZ) / RATE_HZ - LET_GO_S


def _falls(_: float, state: FloatArray, alpha_rad: float) -> list[float]:
    return [float(state[1]), -(P_RAD_S**2) * float(np.sin(alpha_rad - state[0]))]


def _top_late_s(smooth: FloatArray) -> float:
    fall = np.flatnonzero((smooth < 0.95 * HELD_RAD) & (smooth > 0.7 * HELD_RAD))
    bend, slope, _ = np.polyfit(fall / RATE_HZ - LET_GO_S, smooth[fall], 2)
    return float(-0.5 * slope / bend)


def main() -> int:
    """Print the table."""
    print(
        "| held at, of α | sway over it | thrown up by, mrad/s "
        "| release off by, ms: rms; 95 % | top of the fall off by, ms |"
    )
    print("|---|---|---|---|---|")
    drawn = [(share, 0.0) for share in _SHARES] + [(_SHARES[0], thrown) for thrown in _THROWN_RAD_S]
    for alpha, (share, thrown) in itertools.product(_ALPHAS_RAD, drawn):
        rng = np.random.default_rng(3)
        records = [let_go(rng, share, alpha, thrown) for _ in range(_DRAWS)]
        off, top = (1e3 * np.array([found(r) for r in records]) for found in (late_s, _top_late_s))
        print(
            f"| {HELD_RAD / alpha:.2f} | {share:g} | {1e3 * thrown:g} | {np.sqrt(np.mean(off**2)):.1f}; "
            f"{np.percentile(np.abs(off), 95):.1f} | {np.sqrt(np.mean(top**2)):.1f}; "
            f"{np.percentile(np.abs(top), 95):.1f} |"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())

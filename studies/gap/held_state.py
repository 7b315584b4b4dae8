"""How well the state is known in which a wall that sways is let go.

    python -m studies.gap.held_state

Draws a hold that sways by two harmonics of 0.4 to 3 Hz, the second half as large, lets it go after 2 s at an
instant that is known to 4 ms, and prints what `held_state` is off by and what it states, as a table.
"""

from __future__ import annotations

import sys

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.motion.held_state import HeldState, held_state

RATE_HZ, HELD_RAD, LET_GO_S = 4000.0, 0.05, 2.0
PULL_RAD_S2 = 0.6
"""Acceleration of the fall."""
_DRAWS = 150
_CASES = ((2e-5, 7e-5), (8e-5, 7e-5), (2e-4, 7e-5), (1e-4, 1e-5))
"""Amplitude of the first harmonic and noise of a reading, rad."""


def swaying(
    rng: np.random.Generator, amplitude_rad: float, noise_rad: float
) -> tuple[FloatArray, float, float]:
    """A record, (n,), and the rotation and the speed at which it is let go."""
    time_s = np.arange(int((LET_GO_S + 0.4) * RATE_HZ)) / RATE_HZ - LET_GO_S
    held, free = np.minimum(time_s, 0.0), np.maximum(time_s, 0.0)
    theta, speed = np.full(time_s.size, HELD_RAD), 0.0
    for amplitude in (amplitude_rad, 0.5 * amplitude_rad):
        rate, phase = 2.0 * np.pi * rng.uniform(0.4, 3.0), rng.uniform(0.0, 2.0 * np.pi)
        theta = theta + amplitude * np.sin(rate * held + phase)
        speed += amplitude * rate * np.cos(phase)
    rotation = float(theta[-1])
    theta = theta + speed * free - 0.5 * PULL_RAD_S2 * free**2
    return theta + noise_rad * rng.standard_normal(theta.size), rotation, speed


def found(theta: FloatArray, noise_rad: float, at_s: float = LET_GO_S) -> HeldState:
    """The state at a time of a record, (n,)."""
    return held_state(theta, at_s * RATE_HZ, noise_rad, RATE_HZ)


def main() -> int:
    """Print the table."""
    rng = np.random.default_rng(1)
    print(
        "| sway, µrad | noise, µrad | rotation off by, µrad | stated | off over stated, rms; 95 % | "
        "speed off by, mrad/s | stated |"
    )
    print("|---|---|---|---|---|---|---|")
    for amplitude, noise in _CASES:
        off, stated = np.zeros((_DRAWS, 2)), np.zeros((_DRAWS, 2))
        for k in range(_DRAWS):
            theta, rotation, speed = swaying(rng, amplitude, noise)
            state = found(theta, noise, LET_GO_S + 4e-3 * rng.standard_normal())
            off[k] = state.rotation_rad - rotation, state.speed_rad_s - speed
            stated[k] = state.rotation_sd, state.speed_sd
        rms, usual = np.sqrt(np.mean(off**2, axis=0)), np.median(stated, axis=0)
        share = np.abs(off[:, 0]) / stated[:, 0]
        print(
            f"| {1e6 * amplitude:.0f} and {5e5 * amplitude:.0f} | {1e6 * noise:.0f} | {1e6 * rms[0]:.0f} | "
            f"{1e6 * usual[0]:.0f} | {np.sqrt(np.mean(share**2)):.2f}; {np.percentile(share, 95):.2f} | "
            f"{1e3 * rms[1]:.2f} | {1e3 * usual[1]:.2f} |"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())

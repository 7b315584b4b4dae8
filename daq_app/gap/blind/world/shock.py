"""What an impact does to an accelerometer: its velocity jump in a short pulse, and a ringing mount."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from daq_app.gap.blind.world.arrays import FloatArray

ShockForm = Literal["half_sine", "two_lobed", "ringing", "gamma"]

_FADE: Final = 8.0
"""A ringing is followed for this many time constants (0.03 %)."""
_OVERSHOOT: Final = 0.6
"""Area of the second lobe of a two-lobed pulse; the first has 1 + this much."""
_FIRST_LOBE: Final = 0.6
"""Share of the length that the first of two lobes takes."""


@dataclass(frozen=True, slots=True)
class Shock:
    """The shock of all impacts of a case; the defaults are those of the laboratory `own`."""

    form: ShockForm = "half_sine"
    length_s: float = 0.002
    ring_hz: float = 140.0
    """Frequency of the softest mount; the others are stiffer by multiples of 37 Hz."""
    ring_decay_s: float = 0.006
    ring_gain_1_s: float = 300.0
    """Acceleration of the ringing per jump of velocity."""

    @property
    def window_s(self) -> float:
        """After this time nothing is left of it."""
        return max(_FADE * self.ring_decay_s, 2.0 * self.length_s)

    def pulse(self, t: FloatArray) -> FloatArray:
        """Acceleration per jump of velocity, 1/s, at times (n,) after the impact; its integral is 1."""
        match self.form:
            case "half_sine":
                return _half_sine(t, self.length_s)
            case "ringing":
                return _half_sine(t, self.length_s / 3.0)
            case "two_lobed":
                first = _FIRST_LOBE * self.length_s
                second = _half_sine(t - first, self.length_s - first)
                return (1.0 + _OVERSHOOT) * _half_sine(t, first) - _OVERSHOOT * second
            case "gamma":
                constant = self.length_s / 5.0
                return np.where(t >= 0.0, t / constant**2 * np.exp(-np.maximum(t, 0.0) / constant), 0.0)

    def ringing(self, t: FloatArray, channel: str) -> FloatArray:
        """Acceleration per jump of velocity, 1/s, of a channel's mount."""
        frequency = self.ring_hz + 37.0 * (sum(map(ord, channel)) % 7)
        return self.ring_gain_1_s * np.exp(-t / self.ring_decay_s) * np.sin(2.0 * math.pi * frequency * t)


def _half_sine(t: FloatArray, length_s: float) -> FloatArray:
    wave = math.pi / (2.0 * length_s) * np.sin(math.pi * t / length_s)
    return np.where((t >= 0.0) & (t < length_s), wave, 0.0)


def draw_shock(form: ShockForm, length_s: float, rng: np.random.Generator) -> Shock:
    """A shock of a length, with a mount of its own: ringing forms ring for as long as the shock takes."""
    rings = form == "ringing"
    return Shock(
        form,
        length_s,
        ring_hz=float(rng.uniform(60.0, 300.0)),
        ring_decay_s=length_s if rings else float(rng.uniform(0.003, 0.008)),
        ring_gain_1_s=float(rng.uniform(100.0, 600.0) if rings else rng.uniform(50.0, 400.0)),
    )

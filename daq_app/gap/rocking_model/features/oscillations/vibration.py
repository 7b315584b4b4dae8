"""What is known of a vibration of the floor."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Vibration:
    """One run's share: amplitude (m/s²) with its error, and the phase at release (rad), of sin(2πft + φ)."""

    frequency_hz: float
    frequency_sd: float
    amplitude: float
    amplitude_sd: float
    phase: float
    phase_sd: float
    found: bool

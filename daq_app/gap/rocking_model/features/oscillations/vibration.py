"""What is known of a vibration of the floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from daq_app.gap.core.features import FloatArray


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


@dataclass(frozen=True, slots=True)
class FloorSpectrum:
    """Acceleration of the floor along x, by bands of frequency."""

    frequency_hz: FloatArray
    """(k,) middles of the bands."""
    rms_m_s2: FloatArray
    """(k,) in each band."""
    sd_m_s2: float
    """Standard error of the rms over all bands."""

    @property
    def total_m_s2(self) -> float:
        """Rms over all bands."""
        return float(np.linalg.norm(self.rms_m_s2))

    @property
    def loudest_hz(self) -> float:
        """Middle of the loudest band."""
        return float(self.frequency_hz[int(np.argmax(self.rms_m_s2))])

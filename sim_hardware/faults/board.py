"""What is broken on the simulated bench at the moment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim_hardware.faults.model import ClockChange


class FaultBoard:
    """Faults of the bench by kind and place; without any, everything works."""

    def reserved_by(self, resource: str) -> str | None:
        """Who else holds a device."""
        return None

    def forced_rate_hz(self, hosts: Sequence[str]) -> float | None:
        """Rate that a clock is coerced to against all rules."""
        return None

    def clock_changes(self, hosts: Sequence[str]) -> tuple[ClockChange, ...]:
        """How the sample clocks of these chassis or devices run wrong."""
        return ()

    def distort(
        self, terminals: Sequence[str], times_s: NDArray[np.float64], volts: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Volts as the converters see them."""
        return volts

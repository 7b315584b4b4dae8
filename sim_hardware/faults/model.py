"""Plain descriptions that faults hand to the simulated device server."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ClockChange:
    """Between `start_s` and `end_s` a sample clock runs at `factor` times its rate (0: it stands)."""

    start_s: float
    end_s: float
    factor: float

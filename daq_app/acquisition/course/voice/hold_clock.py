"""How long the wall has been held still within the band of its plan."""

from __future__ import annotations


class HoldClock:
    """Counts from the later of two: the wall is still, and it is within the band."""

    def __init__(self) -> None:
        self._sample = 0
        self._outside = 0

    def restart(self, sample: int) -> None:
        """Nothing before that sample counts."""
        self._sample = self._outside = sample

    def look(self, sample: int, ratio: float, band: tuple[float, float] | None) -> None:
        """Take in |θ|/α at a sample; without a band every rotation is within it."""
        self._sample = sample
        if band is not None and not band[0] <= ratio <= band[1]:
            self._outside = sample

    def held_s(self, still_since: int | None, rate_hz: float) -> float:
        """Seconds held, 0 while the wall is not still (`still_since` None)."""
        if still_since is None:
            return 0.0
        return max(0.0, (self._sample - max(still_since, self._outside)) / rate_hz)

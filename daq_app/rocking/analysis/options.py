"""What may be chosen in an analysis; apart from it, so that a choice loads no SciPy."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class AnalysisOptions:
    """What may be chosen."""

    velocity_cutoff_hz: float | None = None
    """Cut-off of the stated filter; the rig's if None."""
    zero_at_rest: bool | None = None
    """Take the zero of every sensor from the rest after the test. None: where the record has no tare."""
    fit: bool = True
    """Fit the whole motion."""
    bias_runs: int = 6
    """Simulated tests behind the methods' bias; 0 leaves it out."""
    seed: int | None = None
    """Seed of the noise in the simulated tests. None: the record's label decides, so that the corrections of
    a campaign's tests share no error, and one record has one bias however it is analysed."""
    keep_series: bool = True

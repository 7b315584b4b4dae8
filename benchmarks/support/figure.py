"""One measured figure: what was measured, against which aim, on how many runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Figure:
    """A benchmark's result; `value` is the median of `runs` runs unless `note` says otherwise."""

    name: str
    value: float
    unit: str
    runs: int = 1
    aim: float | None = None
    better: Literal["low", "high"] = "low"
    note: str = ""

    @property
    def meets_aim(self) -> bool | None:
        """Whether the aim is met; None where there is no aim."""
        if self.aim is None:
            return None
        return self.value <= self.aim if self.better == "low" else self.value >= self.aim

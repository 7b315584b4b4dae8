"""How much a benchmark measures: what its figures need, or just enough to see that it works."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

Size = TypeVar("Size")


@dataclass(frozen=True, slots=True)
class Effort:
    """Chooses the sizes of measurements; figures of a quick one say nothing about speed."""

    quick: bool = False

    def of(self, full: Size, least: Size) -> Size:
        """The size that the figures need, or the least with which the benchmark still runs."""
        return least if self.quick else full

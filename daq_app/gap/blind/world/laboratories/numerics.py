"""How exactly, and by which solver, the motion of a wall is computed: drawn case by case."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

Engine = Literal["events", "contact"]
Solver = Literal["DOP853", "RK45", "LSODA", "Radau"]
Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Numerics:
    """What one case is computed with; the defaults are those of the laboratory `own`."""

    solver: Solver = "DOP853"
    relative_tolerance: float = 1e-8
    step_s: float = 1e-4
    """Time step of the contact engine."""
    settle_s: float = 5e-4
    """Time constant in which a contact of the engine settles: small is hard."""
    cone: Literal["elliptic", "pyramidal"] = "elliptic"
    constraint_solver: Literal["Newton", "CG"] = "Newton"


@dataclass(frozen=True, slots=True)
class NumericsRanges:
    """What the numerics of a laboratory are drawn from; ranges are log-uniform."""

    solvers: tuple[Solver, ...] = ("DOP853",)
    relative_tolerance: Range = (1e-8, 1e-8)
    step_s: Range = (1e-4, 1e-4)
    settle_s: Range = (5e-4, 5e-4)
    cones: tuple[Literal["elliptic", "pyramidal"], ...] = ("elliptic",)
    constraint_solvers: tuple[Literal["Newton", "CG"], ...] = ("Newton",)

    def draw(self, rng: np.random.Generator) -> Numerics:
        return Numerics(
            solver=self.solvers[int(rng.integers(len(self.solvers)))],
            relative_tolerance=log_uniform(self.relative_tolerance, rng),
            step_s=log_uniform(self.step_s, rng),
            settle_s=log_uniform(self.settle_s, rng),
            cone=self.cones[int(rng.integers(len(self.cones)))],
            constraint_solver=self.constraint_solvers[int(rng.integers(len(self.constraint_solvers)))],
        )


def log_uniform(limits: Range, rng: np.random.Generator) -> float:
    """A positive number between two limits, evenly on a logarithmic scale."""
    low, high = limits
    return low * math.exp(float(rng.uniform()) * math.log(high / low))

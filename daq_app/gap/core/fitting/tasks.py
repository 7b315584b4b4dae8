"""The pieces of work of a diagnosis, each of which one process can do alone."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

from daq_app.gap.core.effects import Effect
from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.fitting.fit import Fit, fitted
from daq_app.gap.core.fitting.held_out import HeldOutRun, score
from daq_app.gap.core.fitting.likelihood import Sizes
from daq_app.gap.core.fitting.problem import Columns
from daq_app.gap.core.fitting.screen import Base, Score, Screened


class Task(Protocol):
    """A piece of work that can be sent to another process."""

    def run(self, experiment: Experiment, frozen: Columns) -> Any:
        """`frozen`: columns of the Jacobian without any effect."""
        ...


@dataclass(frozen=True, slots=True)
class FitTask:
    """Fit one hypothesis from where another fit, or a linear step, ended."""

    effects: tuple[Effect, ...]
    known: dict[tuple[str, int | None], float]
    sizes: Sizes
    polish: bool = True
    columns: Columns = field(default_factory=dict)
    """Columns of the Jacobian beyond those without any effect."""

    def run(self, experiment: Experiment, frozen: Columns) -> Fit:
        columns = {**frozen, **self.columns}
        return fitted(experiment, self.effects, self.known, self.sizes, columns, self.polish)


@dataclass(frozen=True, slots=True)
class ScreenTask:
    """See what some further effects promise on top of a fit."""

    base: tuple[Effect, ...]
    found: Fit
    effects: tuple[Effect, ...]
    begin: tuple[tuple[FloatArray, ...], ...]
    """Coordinates from which each effect's steps begin; from all its starts where there are none."""

    def run(self, experiment: Experiment, frozen: Columns) -> list[Screened]:
        base = Base(experiment, self.base, self.found, frozen)
        return [base.screened(*job) for job in zip(self.effects, self.begin, strict=True)]


@dataclass(frozen=True, slots=True)
class FormsTask:
    """Score tests of some forms on top of a fit."""

    base: tuple[Effect, ...]
    found: Fit
    forms: tuple[Effect, ...]

    def run(self, experiment: Experiment, frozen: Columns) -> list[Score]:
        base = Base(experiment, self.base, self.found, frozen)
        return [base.score(form) for form in self.forms]


@dataclass(frozen=True, slots=True)
class ScoreTask:
    """Predict every run from the others under one hypothesis."""

    effects: tuple[Effect, ...]
    whole: Fit
    by: str

    def run(self, experiment: Experiment, frozen: Columns) -> list[HeldOutRun]:
        return score(experiment, self.effects, self.whole, self.by, {**frozen, **self.whole.columns})

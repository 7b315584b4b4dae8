"""How many of a record's samples count: real residuals follow one another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from daq_app.gap.core import Effect, Model, fit
from daq_app.gap.core.features import PlainRun, independent_fraction


def with_independence(model: Model, runs: Sequence[PlainRun], effects: tuple[Effect, ...]) -> list[PlainRun]:
    """The runs with their share of independent samples, from the residual of a rich hypothesis."""
    rich = fit(model, runs, effects)
    fraction = min(independent_fraction(residual) for residual in rich.residuals)
    return [replace(run, features=replace(run.features, independent_fraction=fraction)) for run in runs]

"""How many of a record's samples count: real residuals follow one another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from daq_app.gap.core import Effect, Model, fit
from daq_app.gap.core.features import independent_fraction
from daq_app.gap.own_model import Measured


def with_independence(model: Model, runs: Sequence[Measured], effects: tuple[Effect, ...]) -> list[Measured]:
    """The runs with their share of independent samples, from the residual of a rich hypothesis."""
    rich = fit(model, runs, effects)
    fraction = min(independent_fraction(residual) for residual in rich.residuals)
    return [replace(run, features=replace(run.features, independent_fraction=fraction)) for run in runs]

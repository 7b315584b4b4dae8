"""The protocol of a model, and what it predicts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from daq_app.gap.core.features import FloatArray, Run
from daq_app.gap.core.parameters import Parameter


@dataclass(frozen=True, slots=True)
class Scatter:
    """A random effect whose size is itself estimated, e.g. the scatter of r from impact to impact.

    `median` and `log_sd` are the log-normal prior of its standard deviation.
    """

    name: str
    median: float
    log_sd: float
    unit: str = ""
    meaning: str = ""


@dataclass(frozen=True, slots=True)
class Prediction:
    """Predicted features of one run.

    `features`: shape (n,), in the order of the run's feature set.
    `loadings`: scatter name → d feature / d random effect, of shape (n, k) for k independent
    draws, or (n,) for one independent draw per feature (a diagonal).
    `fixed_loadings`: shape (n, k), draws of unit variance whose size is known (e.g. the
    measurement error of a state from which several features are predicted).
    """

    features: FloatArray
    loadings: Mapping[str, FloatArray] = field(default_factory=dict)
    fixed_loadings: FloatArray | None = None


class Model(Protocol):
    """What the core asks of a model. Implementations must be picklable for work on several cores."""

    @property
    def name(self) -> str: ...

    @property
    def nuisance(self) -> tuple[Parameter, ...]:
        """Parameters shared by all runs, refitted under every hypothesis."""
        ...

    @property
    def scatters(self) -> tuple[Scatter, ...]: ...

    def local_nuisance(self, run: Run) -> tuple[Parameter, ...]:
        """Parameters of one run (release, offsets …)."""
        ...

    def predict(self, run: Run, values: Mapping[str, float]) -> Prediction:
        """Features of `run` at `values` (nuisance, local and ``effect.parameter`` names)."""
        ...

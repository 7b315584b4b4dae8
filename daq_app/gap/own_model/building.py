"""The short way to a run and to a model: arrays and one function."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from daq_app.gap.core import FeatureSet, Label, Model, Parameter, Prediction, Run, Scatter
from daq_app.gap.core.features import FloatArray

Simulate = Callable[["Measured", Mapping[str, float]], "ArrayLike | Prediction"]


@dataclass(frozen=True, slots=True)
class Measured:
    """One recording as the diagnosis sees it, and whatever its simulator wants to know."""

    name: str
    level: str
    features: FeatureSet
    inputs: dict[str, Any] = field(default_factory=dict)

    @property
    def values(self) -> FloatArray:
        """The measured features, shape (n,)."""
        return self.features.values


def measured(
    name: str,
    values: ArrayLike,
    sd: ArrayLike,
    *,
    channel: str,
    observable: str,
    unit: str = "",
    phase: str = "run",
    amplitude: ArrayLike = 0.0,
    level: str = "",
    independent_fraction: float = 1.0,
    **inputs: Any,
) -> Measured:
    """A run of one kind of feature: n numbers in the order of time.

    `sd` is their measurement noise (a number, or n), `amplitude` the size of the motion where each was read,
    with the sign of its side if there are two. Runs of one `level` repeat each other, and a whole level is
    held out at once; each run is its own if it is empty. `inputs` are kept for the simulator.

    Raises `ValueError` for shapes that do not fit, for numbers that are not finite and for noise that is not
    positive.
    """
    y = np.atleast_1d(np.asarray(values, dtype=np.float64))
    noise = np.broadcast_to(np.asarray(sd, dtype=np.float64), y.shape).copy()
    sizes = np.broadcast_to(np.asarray(amplitude, dtype=np.float64), y.shape)
    last = max(y.size - 1, 1)
    labels = tuple(
        Label(channel, phase, observable, unit, float(size), k / last) for k, size in enumerate(sizes)
    )
    return Measured(name, level or name, FeatureSet(y, noise, labels, independent_fraction), inputs)


def model_of(
    name: str,
    simulate: Simulate,
    unknowns: Sequence[Parameter],
    per_run: Sequence[Parameter] = (),
    scatters: Sequence[Scatter] = (),
) -> Model:
    """A model from one function: ``simulate(run, values)`` returns n features, or a `Prediction`.

    `values` has every parameter of `unknowns` (the same in all runs) and `per_run` (each run its own) by its
    name, and ``effect.parameter`` for each effect that is tried: read those with ``values.get(name, 0.0)``.
    """
    return _OneFunction(name, simulate, tuple(unknowns), tuple(per_run), tuple(scatters))


@dataclass(frozen=True)
class _OneFunction:
    name: str
    simulate: Simulate
    nuisance: tuple[Parameter, ...]
    per_run: tuple[Parameter, ...]
    scatters: tuple[Scatter, ...]

    def local_nuisance(self, run: Run) -> tuple[Parameter, ...]:
        return self.per_run

    def predict(self, run: Run, values: Mapping[str, float]) -> Prediction:
        assert isinstance(run, Measured)
        features = self.simulate(run, values)
        return (
            features
            if isinstance(features, Prediction)
            else Prediction(np.asarray(features, dtype=np.float64))
        )

"""A diagnosis to which a measurement is added that no channel of the rig makes: a level, a rule."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from daq_app.gap.core import (
    Diagnosis,
    FeatureSet,
    Label,
    Library,
    Model,
    Options,
    Parameter,
    Prediction,
    Run,
    Scatter,
    diagnose,
)
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.study import model_and_library, prepare

_Values = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Instrument:
    """What is read by hand once."""

    observable: str
    unit: str
    sd: float
    """Standard uncertainty of the reading."""
    predicted: Callable[[_Values], float]
    """What it shows at the values of a hypothesis."""
    resolves: tuple[str, ...] = ()
    """Effects that no sensor of the rig tells apart by the library, and this instrument does."""


LEVEL = Instrument(
    "tilt of the base",
    "rad",
    5e-5,
    lambda values: values.get("base_tilt.beta", 0.0),
    ("base_tilt", "eccentric_mass"),
)
"""A machinist's level of 0.05 mm/m."""
RULE = Instrument("height of the LVDTs' points", "m", 2e-3, lambda values: values["mount_height"])
"""A steel rule."""
_FORMING = ("filter_delay@wire", "slow_response@wire", "wire_inertia@wire")
KNOCK = Instrument(
    "form of a step",
    "1",
    0.2,
    lambda values: float(any(name.partition(".")[0] in _FORMING for name in values)),
    ("lag@wire", "filter_delay@wire"),
)
"""1 where a step comes out in another form (rounded, slower, ringing), 0 where only later: a look at it."""


@dataclass(frozen=True)
class _Reading:
    """The runs, of which the first holds the reading too."""

    inner: Run
    features: FeatureSet

    @property
    def name(self) -> str:
        return self.inner.name

    @property
    def level(self) -> str:
        return self.inner.level


class _WithReading:
    """A model that predicts one more feature in the runs that hold one."""

    def __init__(self, inner: Model, instrument: Instrument) -> None:
        self._inner, self._instrument = inner, instrument
        self.name = inner.name

    @property
    def nuisance(self) -> tuple[Parameter, ...]:
        return self._inner.nuisance

    @property
    def scatters(self) -> tuple[Scatter, ...]:
        return self._inner.scatters

    def local_nuisance(self, run: Run) -> tuple[Parameter, ...]:
        return self._inner.local_nuisance(run.inner if isinstance(run, _Reading) else run)

    def predict(self, run: Run, values: _Values) -> Prediction:
        if not isinstance(run, _Reading):
            return self._inner.predict(run, values)
        found = self._inner.predict(run.inner, values)
        fixed = found.fixed_loadings
        return Prediction(
            np.append(found.features, self._instrument.predicted(values)),
            {name: _longer(loading) for name, loading in found.loadings.items()},
            None if fixed is None else _longer(fixed),
        )


def _longer(loading: np.ndarray) -> np.ndarray:
    """The reading has no part in any random effect."""
    return np.concatenate((loading, np.zeros((1, *loading.shape[1:]))))


def diagnose_with(
    runs: Sequence[GapRun], instrument: Instrument, reading: float, options: Options
) -> Diagnosis:
    """The diagnosis of `runs` and of one `reading` of an instrument."""
    prepared, limits = prepare(runs)
    model, library = model_and_library(prepared)
    label = Label("survey", "held", instrument.observable, instrument.unit)
    first, old = prepared[0], prepared[0].features
    features = FeatureSet(
        np.append(old.values, reading), np.append(old.sd, instrument.sd), (*old.labels, label)
    )
    read: list[Run] = [_Reading(first, features), *prepared[1:]]
    return diagnose(_WithReading(model, instrument), read, _told(library, instrument), options, limits)


def _told(library: Library, instrument: Instrument) -> Library:
    """The library of a rig that has this instrument: less the groups that it tells apart."""
    groups = [group for group in library.groups if not set(group.names) & set(instrument.resolves)]
    return Library([library[name] for name in library], groups)

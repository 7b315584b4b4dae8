"""Diagnosers that lack one part of the method: what each part is worth, on the same sealed cases.

python -m daq_app.cli gap blind run C --diagnoser studies.gap.ablations:without_scatter --results apart
python -m daq_app.cli gap blind score C --labels kept/C --results apart
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from daq_app.config import load_rig
from daq_app.gap.blind.layout import RIG_FILE, run_files
from daq_app.gap.blind.running.diagnosers import Result
from daq_app.gap.core import FeatureSet, Library, Options, Scatter
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.prediction.model import SCATTER_R, RockingModel
from daq_app.gap.rocking_model.records import load_run
from daq_app.gap.rocking_model.run_cache import RunCache
from daq_app.gap.rocking_model.study import diagnose_prepared, model_and_library, prepare

Parts = tuple[RockingModel, Library]


class UnscatteredModel(RockingModel):
    """A likelihood that knows no scatter of r."""

    scatters = (Scatter(SCATTER_R, 1e-6, 1e-3, "1", "held at nothing"), *RockingModel.scatters[1:])


def without_scatter(case: Path) -> Result:
    """The product with a likelihood in which every impact loses the same."""
    return _diagnosed(case, parts=lambda model, library: (_unscattered(model), library))


def without_channels(case: Path) -> Result:
    """The product on θ(t) alone."""
    return _diagnosed(case, runs=lambda prepared: [rotation_alone(run) for run in prepared])


def without_probes(case: Path) -> Result:
    """The product without the free form of each family."""
    return _diagnosed(case, parts=lambda model, library: (model, _named(library)))


def rotation_alone(run: RockingRun) -> RockingRun:
    """The run with what θ(t) says only."""
    n = len(run.places) + run.peaks.size
    old = run.features
    features = FeatureSet(old.values[:n], old.sd[:n], old.labels[:n], old.independent_fraction)
    return replace(run, features=features, blocks=(), fixed_loadings=np.zeros((n, 0)), cache=RunCache())


def _unscattered(model: RockingModel) -> RockingModel:
    return UnscatteredModel(model.survey, model.channels, on_shaking_floor=model.on_shaking_floor)


def _named(library: Library) -> Library:
    return library.without(*(effect.name for effect in library.values() if effect.kind != "effect"))


def _diagnosed(
    case: Path,
    runs: Callable[[Sequence[RockingRun]], Sequence[RockingRun]] = lambda prepared: prepared,
    parts: Callable[[RockingModel, Library], Parts] = lambda model, library: (model, library),
) -> Result:
    """What the product says of a case with other runs, or another model and library."""
    rig = load_rig(case / RIG_FILE)
    prepared, limits = prepare([load_run(path, rig) for path in run_files(case)])
    kept = runs(prepared)
    model, library = parts(*model_and_library(kept))
    return diagnose_prepared(model, kept, library, Options(workers=1), limits).to_dict()

"""The diagnosis with a model of one's own: load, check, diagnose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from daq_app.gap.core import CannotDiagnose, Diagnosis, Options, diagnose
from daq_app.gap.own_model.lint import check_model
from daq_app.gap.own_model.loading import load_model, load_recordings


def diagnose_own(path: Path, recordings: Sequence[Path], options: Options) -> Diagnosis:
    """What the model file at `path` lacks against these recordings.

    It is computed in this process: the functions of a file need not be known to another one. Raises
    `CannotDiagnose` with everything that is wrong with the model or the recordings.
    """
    own_model = load_model(path)
    runs = load_recordings(own_model, recordings)
    lint = check_model(own_model.model, own_model.library, runs)
    if lint.refusals:
        raise CannotDiagnose("\n".join(lint.refusals))
    return diagnose(own_model.model, runs, own_model.library, replace(options, workers=1), lint.notes)

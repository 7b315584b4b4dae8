"""A model file by its path: the three names that it must define, and its recordings."""

from __future__ import annotations

import importlib.util
import sys
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from daq_app.gap.core import CannotDiagnose, Library, Model, Run

_ASK: Final = "daq-app gap starter my_model.py writes one to begin with"
_MODEL_HAS: Final = ("name", "nuisance", "scatters", "local_nuisance", "predict")


@dataclass(frozen=True, slots=True)
class OwnModel:
    """What a model file defines."""

    path: Path
    model: Model
    library: Library
    load: Callable[[Path], Any]
    """One recording → a run, or several."""


def load_model(path: Path) -> OwnModel:
    """Run a model file and take `load`, `model` and `library` from it.

    Raises `CannotDiagnose` for a file that is not there, that fails (with its own line), or that does not
    define these.
    """
    if not path.is_file():
        raise CannotDiagnose(f"There is no model file {path}.", f"{_ASK.capitalize()}.")
    name = f"own_model_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise CannotDiagnose(f"{path} is no Python file.", f"{_ASK.capitalize()}.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    sys.path.insert(0, str(path.resolve().parent))  # what lies beside it can be imported
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise CannotDiagnose(f"{path} fails{_at(error, path)}.", "Mend it and try again.") from error
    finally:
        sys.path.pop(0)
    missing = [wanted for wanted in ("load", "model", "library") if not hasattr(module, wanted)]
    if missing:
        raise CannotDiagnose(f"{path} does not define {' nor '.join(missing)}.", f"{_ASK.capitalize()}.")
    return _checked(path, module.model, module.library, module.load)


def _checked(path: Path, model: Any, library: Any, load: Any) -> OwnModel:
    lacks = [part for part in _MODEL_HAS if not hasattr(model, part)]
    if lacks:
        raise CannotDiagnose(f"`model` of {path} has no {', no '.join(lacks)}.", "Make it with model_of(…).")
    if not isinstance(library, Library):
        raise CannotDiagnose(f"`library` of {path} is no Library.", "Write Library([Effect(…), …]).")
    if not callable(load):
        raise CannotDiagnose(f"`load` of {path} is not a function.", "It takes a path and returns a run.")
    return OwnModel(path, model, library, load)


def load_recordings(own_model: OwnModel, paths: Sequence[Path]) -> list[Run]:
    """All runs of all recordings, in the order given; a folder stands for the files in it.

    Raises `CannotDiagnose` that names the recording that cannot be loaded.
    """
    runs: list[Run] = []
    for path in _files(paths):
        try:
            loaded = own_model.load(path)
        except Exception as error:
            raise CannotDiagnose(
                f"{path} cannot be loaded: `load` fails{_at(error, own_model.path)}.",
                f"Look at the recording, or at `load` in {own_model.path.name}.",
            ) from error
        for run in loaded if isinstance(loaded, list | tuple) else [loaded]:
            if not isinstance(run, Run):
                raise CannotDiagnose(
                    f"`load` of {own_model.path.name} returned {type(run).__name__} for {path}, not a run.",
                    "Return measured(…), or a list of such runs.",
                )
            runs.append(run)
    return runs


def _files(paths: Sequence[Path]) -> list[Path]:
    files: list[Path] = []
    for path in paths:
        if not path.exists():
            raise CannotDiagnose(f"There is no recording {path}.", "Check the path.")
        if path.is_dir():
            files += sorted(p for p in path.iterdir() if p.is_file() and not p.name.startswith("."))
        else:
            files.append(path)
    return files


def _at(error: BaseException, path: Path) -> str:
    """Where in the model file, and with which words, an error came up."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if Path(f.filename) == path]
    where = f" in line {frames[-1].lineno}" if frames else ""
    if isinstance(error, SyntaxError) and error.lineno is not None:
        where = f" in line {error.lineno}"
    return f"{where}: {type(error).__name__}: {error}"

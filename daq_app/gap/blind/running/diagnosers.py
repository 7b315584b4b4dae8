"""What can be put to the test: functions that take the folder of a case and return a result.

The result is the JSON of ``daq-app gap diagnose`` (docs/reference/gap-result.md). A diagnoser is named
``module:function`` and runs in a process of its own that is given nothing but the case's files.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from daq_app.gap.blind.layout import RIG_FILE, run_files

Result = dict[str, Any]
Diagnoser = Callable[[Path], Result]

PRODUCT: Final = "daq_app.gap.blind.running.diagnosers:product"
"""The diagnosis of this program."""


class DiagnoserError(Exception):
    """A diagnoser that cannot be found, or that gave no result."""


def load_diagnoser(name: str) -> Diagnoser:
    """The function behind ``module:function``; raises `DiagnoserError` in words."""
    module_name, _, function_name = name.partition(":")
    try:
        function = getattr(importlib.import_module(module_name), function_name)
    except (ImportError, AttributeError, ValueError) as error:
        raise DiagnoserError(
            f"`{name}` is no diagnoser ({error}). Give module:function, for instance {PRODUCT}"
        ) from None
    if not callable(function):
        raise DiagnoserError(f"`{name}` is not a function")
    diagnoser: Diagnoser = function
    return diagnoser


def product(case: Path) -> Result:
    """What ``daq-app gap diagnose`` says of all runs of the case with its rig file.

    One process: the cases fill the cores.
    """
    from daq_app.config import ConfigError, load_rig
    from daq_app.gap.core import CannotDiagnose, Options
    from daq_app.gap.rocking_model.records import load_run
    from daq_app.gap.rocking_model.study import diagnose_runs
    from daq_app.runfile import RunFileError

    try:
        rig = load_rig(case / RIG_FILE)
        runs = [load_run(path, rig) for path in run_files(case)]
        return diagnose_runs(runs, Options(workers=1)).to_dict()
    except (CannotDiagnose, ConfigError, RunFileError) as refusal:
        raise DiagnoserError(f"gap diagnose refuses: {refusal}") from None

"""What can be put to the test: functions that take the folder of a case and return a result.

The result is the JSON of ``daq-app gap diagnose`` (docs/gap-method.md). A diagnoser is named
``module:function`` and runs in a process of its own that is given nothing but the case's files.
"""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from daq_app.gap.blind.layout import RIG_FILE, run_files

Result = dict[str, Any]
Diagnoser = Callable[[Path], Result]

PRODUCT: Final = "daq_app.gap.blind.diagnosers:product"
"""The diagnosis of this program, as its command does it."""


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
    found: Diagnoser = function
    return found


def product(case: Path) -> Result:
    """``daq-app gap diagnose`` on all runs of the case with its rig file, as a user would call it.

    One process: the cases fill the cores.
    """
    out = case / "result.json"
    command = [sys.executable, "-m", "daq_app.cli", "gap", "diagnose", *map(str, run_files(case))]
    command += ["--rig", str(case / RIG_FILE), "--json", str(out), "--cores", "1"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not out.exists():
        raise DiagnoserError(f"gap diagnose ended with {done.returncode}: {done.stderr.strip()[-2000:]}")
    result: Result = json.loads(out.read_text(encoding="utf-8"))
    return result

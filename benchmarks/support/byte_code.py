"""Programs are timed with their byte code there, as it is wherever they have been started before.

Some surroundings forbid to write it; then every process of a program translates all its modules anew.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_FORBIDDING = "PYTHONDONTWRITEBYTECODE"
_PLACE = "PYTHONPYCACHEPREFIX"


def surroundings(folder: Path) -> dict[str, str]:
    """Environment of a process that finds its byte code: in `folder` where the usual place is forbidden."""
    if _FORBIDDING not in os.environ:
        return dict(os.environ)
    kept = {name: value for name, value in os.environ.items() if name != _FORBIDDING}
    return kept | {_PLACE: str(folder)}


@contextmanager
def byte_code_of(*modules: str) -> Iterator[None]:
    """Processes that are started meanwhile find the byte code of `modules` and of all that these import."""
    before = os.environ.get(_PLACE)
    with tempfile.TemporaryDirectory() as name:
        environment = surroundings(Path(name))
        command = [sys.executable, "-c", f"import {', '.join(modules)}"]
        subprocess.run(command, check=True, env=environment)
        if _PLACE in environment:
            os.environ[_PLACE] = environment[_PLACE]
        try:
            yield
        finally:
            os.environ.pop(_PLACE, None)
            if before is not None:
                os.environ[_PLACE] = before

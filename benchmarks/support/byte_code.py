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


def surroundings(folder: Path) -> dict[str, str]:
    """Environment of a process that keeps its byte code in `folder` and finds it there."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return kept | {"PYTHONPYCACHEPREFIX": str(folder)}


@contextmanager
def byte_code_of(*modules: str) -> Iterator[None]:
    """Processes that are started meanwhile find the byte code of `modules` and of all that these import."""
    before = os.environ.get("PYTHONPYCACHEPREFIX")
    with tempfile.TemporaryDirectory() as name:
        command = [sys.executable, "-c", f"import {', '.join(modules)}"]
        subprocess.run(command, check=True, env=surroundings(Path(name)))
        os.environ["PYTHONPYCACHEPREFIX"] = name
        try:
            yield
        finally:
            if before is None:
                del os.environ["PYTHONPYCACHEPREFIX"]
            else:
                os.environ["PYTHONPYCACHEPREFIX"] = before

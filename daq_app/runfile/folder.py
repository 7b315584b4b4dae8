"""What belongs to runs in a folder."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from daq_app.runfile.errors import RunFileError

JOURNAL_SUFFIX: Final = ".journal"
RUN_SUFFIX: Final = ".h5"


def find_journals(folder: Path) -> list[Path]:
    """Journals in a folder and below, in order of name; links and hidden folders are not followed."""
    return _find(folder, JOURNAL_SUFFIX)


def find_runs(folder: Path) -> list[Path]:
    """Run files in a folder and below, in order of name; links and hidden folders are not followed."""
    return _find(folder, RUN_SUFFIX)


def require_replaceable(out: Path, inputs: Sequence[Path] = (), *, overwrite: bool) -> None:
    """Return if a result may be written to `out`. Raises `RunFileError` if not.

    A recording and a file that is read are never replaced, another file only where that was asked for.
    """
    if out.suffix in (RUN_SUFFIX, JOURNAL_SUFFIX):
        raise RunFileError(
            f"{out} has the name of a recording, which no result replaces", advice="Choose another name."
        )
    if out.is_dir():
        raise RunFileError(f"{out} is a folder", advice="Name the file to write.")
    if not out.exists():
        return
    if any(path.exists() and out.samefile(path) for path in inputs):
        raise RunFileError(f"{out} is read by this command", advice="Choose another name for the result.")
    if not overwrite:
        raise RunFileError(f"{out} exists already", advice="Choose another name, or say --overwrite.")


def _find(folder: Path, suffix: str) -> list[Path]:
    found: list[Path] = []
    for parent, folders, files in os.walk(folder):
        # Hidden folders hold what some program has not finished (`campaign simulate`) or its own affairs: the
        # ring of a recorder comes and goes while somebody looks.
        folders[:] = [name for name in folders if not name.startswith(".")]
        paths = (Path(parent, name) for name in files if os.path.normcase(name).endswith(suffix))
        found += [path for path in paths if path.is_file() and not path.is_symlink()]
    return sorted(found)

"""Rig files and campaigns that come with the program, to be used as they are or copied and edited."""

from __future__ import annotations

import shutil
from pathlib import Path

from daq_app.config.errors import ConfigError, Problem

_FOLDER = "configs"


def shipped_configs() -> Path:
    """Folder of the files: inside the installed package, or ``configs`` of a checkout."""
    installed = Path(__file__).parents[1] / _FOLDER
    return installed if installed.is_dir() else Path(__file__).parents[2] / _FOLDER


def here_or_shipped(path: Path) -> Path:
    """`path` (``configs/…``) if it exists, else the file of that name that comes with the program."""
    return path if path.exists() else shipped_configs() / path.relative_to(_FOLDER)


def copy_shipped(folder: Path) -> list[Path]:
    """Copy all files into `folder`. Returns the copies.

    Raises `ConfigError` before anything is written where one of them exists: it may have been edited.
    Raises `OSError`; no copy is left then.
    """
    source = shipped_configs()
    names = sorted(path.relative_to(source) for path in source.rglob("*.toml"))
    there = [folder / name for name in names if (folder / name).exists()]
    if there:
        wrong = "exists and may have been edited"
        raise ConfigError([Problem(str(path), "", wrong, "Name another folder") for path in there])
    copies = [folder / name for name in names]
    try:
        for name, copy in zip(names, copies, strict=True):
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source / name, copy)
    except OSError:
        for copy in copies:
            copy.unlink(missing_ok=True)
        raise
    return copies

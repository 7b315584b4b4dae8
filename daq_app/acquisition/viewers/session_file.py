"""The file that tells viewers on this machine where the acquisition is and how to command it."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import Final

from pydantic import BaseModel, ConfigDict, ValidationError

NAME: Final = ".acquisition.json"
_MAX_BYTES: Final = 64 * 1024


class SessionFile(BaseModel):
    """Readable by the user who runs the acquisition only: the token is the right to command."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    address: str
    token: str
    pid: int
    rig: str = ""


def write_session_file(folder: Path, content: SessionFile) -> Path:
    """Write it for nobody else's eyes; replaces what a dead session left."""
    path = folder / NAME
    path.unlink(missing_ok=True)
    fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(fd, "w", encoding="utf-8") as file:
        file.write(content.model_dump_json(indent=1))
    return path


def read_session_file(folder: Path) -> SessionFile | None:
    """The session that records into `folder`, or None if there is none to be found."""
    path = folder / NAME
    try:
        if path.stat().st_size > _MAX_BYTES:
            return None
        return SessionFile.model_validate_json(path.read_text(encoding="utf-8"))
    except (OSError, ValidationError, ValueError):
        return None


def remove_session_file(folder: Path) -> None:
    """The session has ended."""
    with contextlib.suppress(OSError):
        (folder / NAME).unlink(missing_ok=True)

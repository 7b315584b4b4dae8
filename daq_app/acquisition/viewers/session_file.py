"""The file that tells viewers on this machine where the acquisition is and how to command it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from pydantic import BaseModel, ConfigDict, ValidationError

from daq_app.runfile import RunFileError
from daq_app.runfile.durable import create_anew, name_beside, remove, replace_durably

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
    """Write it for nobody else's eyes; replaces what a dead session left. Raises `RunFileError`.

    A viewer that looks for a session may be reading what is replaced, which Windows refuses meanwhile.
    """
    path = folder / NAME
    beside = name_beside(path)
    try:
        with os.fdopen(create_anew(beside, 0o600), "wb") as file:
            file.write(content.model_dump_json(indent=1).encode())
        return replace_durably(beside, path)
    except OSError as error:
        raise RunFileError(
            f"{path} cannot be written ({error.strerror or error})",
            advice="Viewers find the acquisition by it: close the program that has it open, and start again.",
        ) from error
    finally:
        remove(beside)


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
    remove(folder / NAME)

"""SHA-256 of whole files, as any tool computes it."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Final

_READ_AT_ONCE: Final = 2**20


def file_sha256(path: Path) -> str:
    """SHA-256 of a file, hexadecimal. Raises `OSError` where it cannot be read."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while piece := file.read(_READ_AT_ONCE):
            digest.update(piece)
    return digest.hexdigest()

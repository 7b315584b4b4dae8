"""Which code a figure was measured with: the commit, and a mark for the files that matter."""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True, slots=True)
class CodeState:
    """`commit`: short name, ``unknown`` outside a checkout. `code`: digest of the files that matter.

    Two commits with the same digest have the same code there; a changed file gives another digest,
    whether it is committed or not.
    """

    commit: str
    code: str


def code_state(paths: Sequence[str]) -> CodeState:
    """State of the files below `paths` (relative to the repository), as they lie on the disk."""
    digest = hashlib.sha256()
    for path in paths:
        whole = ROOT / path
        files = sorted(whole.rglob("*.py")) if whole.is_dir() else [whole]
        for file in files:
            digest.update(file.relative_to(ROOT).as_posix().encode())
            digest.update(file.read_bytes().replace(b"\r\n", b"\n"))
    return CodeState(_commit(paths), digest.hexdigest()[:12])


def _commit(paths: Sequence[str]) -> str:
    """Short name of the commit, with a + where files that matter differ from it."""
    try:
        name = _git("rev-parse", "--short=7", "HEAD")
        changed = _git("status", "--porcelain", "--", *paths)
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return name + ("+" if changed else "")


def _git(*arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True)
    return done.stdout.strip()

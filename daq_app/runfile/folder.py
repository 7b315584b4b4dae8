"""What belongs to runs in a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Final

JOURNAL_SUFFIX: Final = ".journal"
RUN_SUFFIX: Final = ".h5"


def find_journals(folder: Path) -> list[Path]:
    """Journals in a folder and below, in order of name; links and hidden folders are not followed."""
    return _find(folder, JOURNAL_SUFFIX)


def find_runs(folder: Path) -> list[Path]:
    """Run files in a folder and below, in order of name; links and hidden folders are not followed."""
    return _find(folder, RUN_SUFFIX)


def _find(folder: Path, suffix: str) -> list[Path]:
    # Hidden folders hold what some program has not finished (`campaign simulate`), or its own affairs.
    return sorted(
        path
        for path in folder.rglob(f"*{suffix}")
        if path.is_file()
        and not path.is_symlink()
        and not any(part.startswith(".") for part in path.relative_to(folder).parts[:-1])
    )

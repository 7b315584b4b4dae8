"""Names of the files and folders of a check. Imports nothing heavy: every diagnosis starts with it."""

from __future__ import annotations

from pathlib import Path
from typing import Final

CASE_PREFIX: Final = "case_"
RIG_FILE: Final = "rig.toml"
SEAL_FILE: Final = "seal.json"
RESULTS: Final = "results"


def run_files(case: Path) -> list[Path]:
    """Run files of a case in the order of their names."""
    return sorted(case.glob("*.h5"))

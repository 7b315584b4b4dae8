"""Where a diagnosis leaves its result beside the runs. Imports nothing heavy."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

SUFFIX: Final = ".gap.json"


def result_path(runs: Sequence[Path]) -> Path:
    """Where the result of these runs goes: beside them, named after the only run or their specimen."""
    if len(runs) == 1:
        return runs[0].with_suffix(SUFFIX)
    specimens = {run.stem.split("-")[0] for run in runs}
    return runs[0].parent / f"{specimens.pop() if len(specimens) == 1 else 'runs'}{SUFFIX}"


def newest_result(folder: Path) -> Path | None:
    """The result in a folder that was written last."""
    files = sorted(folder.glob(f"*{SUFFIX}"), key=lambda path: path.stat().st_mtime)
    return files[-1] if files else None

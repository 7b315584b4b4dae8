"""Diagnoses of many specimens side by side, on this machine's cores or on many machines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from daq_app.campaign.recorded import read_recorded
from daq_app.campaign.status import TestVerdict
from daq_app.config import Rig
from daq_app.runfile import RunFileError
from daq_app.runfile.folder import RUN_SUFFIX
from daq_app.workers import Workers, run_all

_USED = (TestVerdict.GOOD, TestVerdict.UNCHECKED)


@dataclass(frozen=True, slots=True)
class Specimen:
    """The tests of one specimen in one campaign folder that a diagnosis may use."""

    folder: Path
    name: str
    runs: tuple[Path, ...]
    left_out: tuple[str, ...]
    """Tests that were rejected, failed their check or have no run file, by name."""

    @property
    def title(self) -> str:
        """Folder and specimen, also the name of the file of the result."""
        return f"{self.folder.name}-{self.name}"


@dataclass(frozen=True, slots=True)
class Diagnosed:
    """What became of the diagnosis of one specimen: a result, or why there is none."""

    specimen: Specimen
    verdict: str
    """Of the decision; empty where there is no result."""
    sentence: str
    """Of the decision, or the reason why there is no result."""
    document: str
    """The whole result as JSON; empty where there is none."""


def specimens_of(folder: Path) -> list[Specimen]:
    """The specimens of a campaign folder, in the order of their names.

    Raises `ConfigError` if the operator's verdicts cannot be read, `RunFileError` if there is no folder.
    """
    found: dict[str, tuple[list[Path], list[str]]] = {}
    for test in sorted(read_recorded(folder), key=lambda test: test.released_ns):
        runs, left_out = found.setdefault(test.name.specimen, ([], []))
        if test.verdict in _USED and test.path is not None and test.path.suffix == RUN_SUFFIX:
            runs.append(test.path)
        else:
            left_out.append(str(test.name))
    return [Specimen(folder, name, tuple(runs), tuple(out)) for name, (runs, out) in sorted(found.items())]


def diagnose_all(
    specimens: Sequence[Specimen],
    *,
    rig: Rig | None = None,
    causes: int = 3,
    workers: Workers = None,
    done: Callable[[int, Specimen], None] | None = None,
) -> list[Diagnosed]:
    """Diagnose every specimen by itself, in the order given; one that is refused does not stop the others.

    `rig` replaces the rig file that each run carries; `causes` is the largest number that is sought together.
    With the address of a scheduler (`daq_app.machines`) folders must be absolute paths that its workers see.
    """
    return run_all(partial(diagnose_one, rig=rig, causes=causes), specimens, workers, done)


def diagnose_one(specimen: Specimen, *, rig: Rig | None = None, causes: int = 3) -> Diagnosed:
    """Diagnose one specimen in this process."""
    # Imported here: the process that hands out the work needs no model.
    from daq_app.gap.core import CannotDiagnose, Options
    from daq_app.gap.rocking_model.records import load_run
    from daq_app.gap.rocking_model.study import diagnose_runs

    try:
        loaded = [load_run(path, rig) for path in specimen.runs]
        result = diagnose_runs(loaded, Options(causes=causes, workers=1))
    except (CannotDiagnose, RunFileError, OSError) as refusal:
        return Diagnosed(specimen, "", str(refusal), "")
    return Diagnosed(specimen, result.decision.verdict, result.decision.sentence, result.to_json())

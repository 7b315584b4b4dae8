"""One door to all export formats: checks, a temporary file, and the final name only when all is written."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Final, Literal

from daq_app.runfile.durable import name_beside, replace_durably, write_whole
from daq_app.runfile.errors import RunFileError
from daq_app.runfile.exporters.results import Decimal, tidy_csv
from daq_app.runfile.exporters.selection import Selection, Units
from daq_app.runfile.folder import JOURNAL_SUFFIX, RUN_SUFFIX
from daq_app.runfile.hdf5.read import Run, open_run
from daq_app.runfile.model import DerivedData, RunHeader

ExportFormat = Literal["csv", "mat", "tdms", "parquet", "netcdf", "npz"]
FORMATS: Final[dict[str, str]] = {
    "csv": ".csv",
    "mat": ".mat",
    "tdms": ".tdms",
    "parquet": ".parquet",
    "netcdf": ".nc",
    "npz": ".npz",
}
"""Format → suffix of its files."""
RESULTS_SUFFIX: Final = ".results.csv"
"""In place of the format's suffix: the tidy table of results."""


def export_run(
    path: Path,
    out: Path,
    format_: ExportFormat,
    *,
    units: Units = "si",
    from_s: float | None = None,
    to_s: float | None = None,
    overwrite: bool = False,
    report: Callable[[float], None] = lambda fraction: None,
    derive: Callable[[Run], DerivedData | None] = lambda run: None,
    decimal: Decimal = "point",
    level_of: Callable[[str], str] = lambda test: "",
) -> Path:
    """Write a run, or the times ``from_s ≤ t < to_s`` of it, in another format; returns the file's path.

    Where another program holds a file of that name open, the new one is called ``NAME (2)``.

    `out` is the file, or a folder in which it is named after the run.  An hour of recording needs no
    more memory than a minute (MAT: one channel at a time).  Samples in gaps are NaN.  What `derive`
    computes of the run goes with it: its signals beside the channels, its results within the file and as a
    tidy table ``….results.csv`` beside it; `level_of` the test's name is its level there where the run's plan
    names none.  Raises `RunFileError`; then, or when interrupted, nothing new is
    left on disk.
    """
    final = _final_name(path, out, format_, overwrite=overwrite)
    temporary = name_beside(final)
    with open_run(path) as run:
        selection = Selection.of(run, units, from_s, to_s, report, derive(run), decimal)
        write = importlib.import_module(f"daq_app.runfile.exporters.to_{format_}").write
        beside = final.with_suffix(RESULTS_SUFFIX)
        table = _tidy_table(run.header, selection, level_of).encode()
        try:
            if selection.results and not overwrite and beside.exists() and beside.read_bytes() != table:
                raise RunFileError(
                    f"{beside} exists already and says something else",
                    advice="Choose another name, or overwrite it: --overwrite.",
                )
            temporary.unlink(missing_ok=True)  # it may be a link to another file
            write(temporary, selection)
            final = replace_durably(temporary, final, other_name=True)
            if selection.results:
                write_whole(final.with_suffix(RESULTS_SUFFIX), table, other_name=True)
        except OSError as error:
            raise RunFileError(
                f"{final} cannot be written ({error.strerror or error})",
                advice="Check that the folder exists, is writable and has room.",
            ) from error
        finally:
            temporary.unlink(missing_ok=True)
    return final


def _final_name(path: Path, out: Path, format_: ExportFormat, *, overwrite: bool) -> Path:
    """Where the export of the run `path` goes; raises `RunFileError` where it cannot or must not."""
    suffix = FORMATS.get(format_)
    if suffix is None:
        raise RunFileError(f"there is no export format {format_}", advice=f"Formats: {', '.join(FORMATS)}.")
    final = out / f"{path.stem}{suffix}" if out.is_dir() else out
    if final.exists() and (final.suffix in (RUN_SUFFIX, JOURNAL_SUFFIX) or final.samefile(path)):
        raise RunFileError(
            f"{final} is a recording, which an export never replaces", advice="Choose another name."
        )
    if final.exists() and not overwrite:
        raise RunFileError(
            f"{final} exists already", advice="Choose another name, or overwrite it: --overwrite."
        )
    if not final.parent.is_dir():
        raise RunFileError(f"the folder {final.parent} does not exist", advice="Make it first.")
    return final


def _tidy_table(header: RunHeader, selection: Selection, level_of: Callable[[str], str]) -> str:
    planned = "" if header.test_plan is None else header.test_plan.level
    level = planned or level_of(header.test)
    return tidy_csv(header.test or header.run_id, level, selection.results, selection.decimal)

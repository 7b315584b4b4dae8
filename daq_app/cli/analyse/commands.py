"""`daq-app analyse`: everything that one recorded test tells."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from daq_app.cli.analyse.bias import with_whole_chain_bias
from daq_app.cli.analyse.files import output_files, write_outputs
from daq_app.cli.analyse.tables import analysis_tables
from daq_app.cli.errors import EXIT_BAD_INPUT, EXIT_FAILED, print_paragraph, reported
from daq_app.cli.terminal import Console, echo, echo_json
from daq_app.config import Rig, load_rig
from daq_app.runfile.folder import require_replaceable

if TYPE_CHECKING:
    from daq_app.rocking import AnalysisOptions, TestAnalysis

_WIDTH: Final = 160
"""Characters of a line in a file or pipe, which has no width: no number is parted from its error."""


def register(app: typer.Typer) -> None:
    """Add the command ``analyse``."""
    app.command("analyse", epilog="Example: daq-app analyse runs/FR1-L3-2.h5 --out results")(analyse)


def analyse(
    run: Annotated[Path, typer.Argument(help="Run file (HDF5).", metavar="RUN")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the whole analysis as JSON.")] = False,
    out: Annotated[
        Path | None, typer.Option(help="Also write JSON, CSV tables and a picture into this folder.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files that are there.")] = False,
    rig: Annotated[
        Path | None, typer.Option(help="Use this rig file in place of the one kept in the run.")
    ] = None,
    cutoff: Annotated[
        float | None, typer.Option(help="Cut-off of the velocity filter, Hz; the rig's if left out.")
    ] = None,
    zero_at_rest: Annotated[
        bool | None,
        typer.Option(
            "--zero-at-rest/--keep-zero",
            help="Take every sensor's zero from the rest after the test, or keep the one the run has. "
            "Left out: from the rest where the run has no tare.",
        ),
    ] = None,
    bias_runs: Annotated[
        int, typer.Option(min=0, max=1000, help="Simulated tests behind each method's bias; 0: none.")
    ] = 6,
    chain_runs: Annotated[
        int,
        typer.Option(
            min=0, max=1000, help="As well, whole simulated tests with all sensors (about 1 s each)."
        ),
    ] = 0,
) -> None:
    """Analyse a recorded test: θ0, impacts, peaks, speeds, periods, r by each method, base joint.

    Exit code 0; 1 where the run shows no release test; 2 for a file that cannot be used.
    """
    from daq_app.rocking import AnalysisOptions  # here: `daq-app --help` should not load SciPy

    with reported():
        for target in output_files(out, run.stem) if out is not None else ():
            require_replaceable(target, [run], overwrite=overwrite)
        replacement = load_rig(rig) if rig is not None else None
        options = AnalysisOptions(
            velocity_cutoff_hz=cutoff,
            zero_at_rest=zero_at_rest,
            bias_runs=bias_runs,
            keep_series=out is not None,
        )
        analysis, used = _analysis(run, replacement, options)
        if chain_runs and analysis.found:
            analysis = with_whole_chain_bias(analysis, used, chain_runs)
        _show(analysis, as_json=as_json)
        if out is not None:
            written = _written(analysis, out, run.stem)
            if not as_json:
                echo("Written: " + ", ".join(str(path) for path in written))
    raise typer.Exit(0 if analysis.found else EXIT_FAILED)


def _analysis(run: Path, replacement: Rig | None, options: AnalysisOptions) -> tuple[TestAnalysis, Rig]:
    """The analysis of a run file, and the rig that it was made with."""
    from daq_app.rocking import TestRecord, analyse_record
    from daq_app.runfile import open_run

    with open_run(run) as opened:
        used = replacement or opened.rig
        if used is None:
            print_paragraph(
                "Error",
                f"{run}: this version does not understand the rig file kept in this run. Give one with --rig",
            )
            raise typer.Exit(EXIT_BAD_INPUT)
        try:
            analysis = analyse_record(TestRecord.from_run(opened, used), options)
        except (ValueError, KeyError) as error:
            print_paragraph("Error", f"{run}: {error}")
            raise typer.Exit(EXIT_BAD_INPUT) from None
        if replacement is not None and opened.rig not in (None, replacement):
            analysis = _with_rig_told(analysis, replacement, opened.header.rig_name)
        return analysis, used


def _with_rig_told(analysis: TestAnalysis, used: Rig, kept: str) -> TestAnalysis:
    """The analysis with a note that its rig is another one than the run was recorded with."""
    from daq_app.rocking.analysis.results import QualityNote

    text = f"analysed with the rig {used.name} of --rig, which differs from {kept}, the one kept in the run"
    return replace(analysis, notes=(QualityNote("info", text), *analysis.notes))


def _show(analysis: TestAnalysis, *, as_json: bool) -> None:
    if as_json:
        echo_json(analysis.as_dict())
        return
    console = Console()
    if not console.is_terminal:
        console = Console(width=_WIDTH)
    for part in analysis_tables(analysis):
        console.print(part)


def _written(analysis: TestAnalysis, out: Path, stem: str) -> list[Path]:
    try:
        return write_outputs(analysis, out, stem)
    except OSError as error:
        print_paragraph("Error", f"the results could not be written into {out}: {error}")
        raise typer.Exit(EXIT_BAD_INPUT) from None

"""`daq-app verify`, `recover`, `export`: runs and journals on disk."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from daq_app.cli.errors import EXIT_FAILED, print_paragraph, reported, say_other_name
from daq_app.cli.runs.output_place import file_or_folder
from daq_app.cli.terminal import Console, echo, echo_json, progress_on_stderr
from daq_app.runfile import (
    DerivedData,
    JournalContents,
    Recovery,
    VerifyReport,
    recover,
    verify,
)
from daq_app.runfile.exporters import Decimal, ExportFormat, export_run


def register(app: typer.Typer) -> None:
    """Add the commands to the root."""
    app.command("verify", epilog="Example: daq-app verify runs")(verify_command)
    app.command("recover", epilog="Example: daq-app recover runs")(recover_command)
    app.command("export", epilog="Example: daq-app export runs/FR1-L3-2.h5 --format mat --out exported/")(
        export_command
    )


def verify_command(
    paths: Annotated[list[Path], typer.Argument(help="Runs, journals or folders of them.", metavar="PATH…")],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON list.")] = False,
) -> None:
    """Say of each run and journal that every sample is there or known to be missing, or what is wrong.

    Every sample is read and its checksums proven. Exit code 0 if all is well, 1 if not.
    """
    with reported():
        with Console(stderr=True).status("reading every sample …"):
            reports = [verify(path) for path in paths]
        if as_json:
            echo_json([_report_dict(report) for report in reports])
        else:
            _print_reports(reports)
    if not all(report.ok for report in reports):
        raise typer.Exit(EXIT_FAILED)


def _report_dict(report: VerifyReport) -> dict[str, Any]:
    return {
        "path": str(report.path),
        "kind": report.kind,
        "ok": report.ok,
        "problems": list(report.problems),
        "notes": list(report.notes),
        "n_samples": report.n_samples,
        "lost_samples": report.lost_samples,
        "duration_s": report.duration_s,
        "proven": report.proven,
        "children": [_report_dict(child) for child in report.children],
    }


def _print_reports(reports: list[VerifyReport]) -> None:
    """A table of verdicts, and under it every problem and note as a sentence of its own."""
    table = Table(box=None)
    for column in ("file", "kind", "verdict", "proven"):
        table.add_column(column, overflow="fold")
    for column in ("samples", "missing"):
        table.add_column(column, justify="right")
    remarks: list[tuple[str, str, str]] = []
    for report in reports:
        for item in (*report.children, report):
            name = str(item.path.relative_to(report.path)) if item is not report else str(item.path)
            verdict = Text("BAD", "bold red") if item.problems else Text("good", "green")
            if item.kind != "folder":
                numbers = (str(item.n_samples), str(item.lost_samples))
                table.add_row(name, item.kind, verdict, item.proven or "nothing", *numbers)
            told = [("bold red", text) for text in item.problems] + [("bold", text) for text in item.notes]
            remarks += [(style, name, text.replace(str(item.path), "it")) for style, text in told]
    console = Console()
    if table.row_count:
        console.print(table)
    for style, name, text in remarks:
        line = Text(f"{name}: ", style=style)
        line.append(text, style="default")
        console.print(line, soft_wrap=True)


def recover_command(
    folder: Annotated[Path, typer.Argument(help="A folder of runs, or one journal.", metavar="DIR")],
    quick: Annotated[
        bool, typer.Option("--quick", help="Take runs that are there for good without reading every sample.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON list.")] = False,
) -> None:
    """Make a run of every journal that has none yet, or whose run is damaged. Safe to repeat.

    Journals are never changed, damaged runs are set aside and never deleted, and a journal that is
    being recorded is left alone. Exit code 1 if a journal could not be used.
    """
    with reported():
        with Console(stderr=True).status("recovering …"):
            rings = _recovered_rings(folder)
            results = recover(folder, thorough=not quick, derive=_derived)
            unmade = _made_results(results)
        if as_json:
            echo_json([_recovery_dict(result) for result in results])
        elif not results:
            echo(f"{folder}: no journals, nothing to recover")
        for text in () if as_json else (*rings, *unmade):
            echo(text)
        for result in () if as_json else results:
            if result.outcome == "failed":
                print_paragraph("Not recovered", result.text)
            else:
                echo(f"{result.journal}: {result.outcome}: {result.text}")
    if any(result.outcome == "failed" for result in results):
        raise typer.Exit(EXIT_FAILED)


def _recovered_rings(folder: Path) -> list[str]:
    """Journals of releases that a dead recorder had in its ring; what was found, in words."""
    if not folder.is_dir():
        return []
    from daq_app.acquisition.pipeline.ring import ring_sessions

    if not ring_sessions(folder):
        return []
    from daq_app.acquisition.closing.ring_recovery import recover_rings

    return [found.text for found in recover_rings(folder)]


def _made_results(results: Sequence[Recovery]) -> list[str]:
    """Make the result of every run that was recovered; why there is none, where there is none."""
    runs = [result.run for result in results if result.outcome == "recovered" and result.run is not None]
    if not runs:
        return []
    from daq_app.campaign.result.result import NoResult, make_result

    told = []
    for run in runs:
        try:
            make_result(run)
        except (NoResult, OSError) as error:
            told.append(f"{run.name}: no result: {error}")
    return told


def _derived(contents: JournalContents) -> DerivedData | None:
    from daq_app.acquisition.closing.derive import (
        derive,  # loads the analysis: only where there is a run to make
    )

    return derive(contents)[0]


def _recovery_dict(result: Recovery) -> dict[str, Any]:
    return {
        "journal": str(result.journal),
        "outcome": result.outcome,
        "text": result.text,
        "run": None if result.run is None else str(result.run),
        "n_samples": result.n_samples,
        "lost_samples": result.lost_samples,
    }


def export_command(
    run: Annotated[Path, typer.Argument(help="A run file.", metavar="RUN")],
    format_: Annotated[ExportFormat, typer.Option("--format", help="What to write.")],
    out: Annotated[
        Path,
        typer.Option(
            "--out", help="Folder to write into (made if need be), or the file, named with its suffix."
        ),
    ] = Path(),
    raw: Annotated[
        bool, typer.Option("--raw/--si", help="Readings of the channels, or SI with offset and tare off.")
    ] = False,
    from_s: Annotated[
        float | None, typer.Option("--from", help="First time in seconds, on the run's time axis.")
    ] = None,
    to_s: Annotated[float | None, typer.Option("--to", help="Time in seconds before which to stop.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a file that is there.")] = False,
    derived: Annotated[
        bool,
        typer.Option(
            "--derived/--channels-only",
            help="With rotation, velocity, phases, half-cycles and r (and a tidy table beside), or without.",
        ),
    ] = True,
    decimal: Annotated[
        Decimal,
        typer.Option("--decimal", help="Decimal mark of CSV; comma goes with semicolons between columns."),
    ] = "point",
) -> None:
    """Write a run, or a part of it, as CSV, MATLAB, TDMS, Parquet, netCDF or NumPy file.

    The file appears under its name only when it is complete; gaps are NaN. What `analyse` computes goes with
    it, and stands as a tidy table in NAME.results.csv.
    """
    from daq_app.campaign.names import level_in
    from daq_app.cli.analyse.derived import derived_of

    with (
        reported(),
        file_or_folder(out) as place,
        progress_on_stderr() as progress,
    ):
        task = progress.add_task(escape(f"{run.name} → {format_}"), total=1.0)
        path = export_run(
            run,
            place,
            format_,
            units="raw" if raw else "si",
            from_s=from_s,
            to_s=to_s,
            overwrite=overwrite,
            report=lambda fraction: progress.update(task, completed=fraction),
            derive=derived_of if derived else lambda run: None,
            decimal=decimal,
            level_of=level_in,
        )
    if not place.is_dir():
        say_other_name(place, path)
    echo(f"{path}: written, {path.stat().st_size / 1e6:.1f} MB")

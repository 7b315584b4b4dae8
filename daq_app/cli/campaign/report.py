"""`daq-app campaign report`: from run files to Table 4.1 and Figures 4.1 to 4.4."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from daq_app.campaign.status import TestVerdict
from daq_app.cli.campaign.progress import DEFAULT_PLAN, open_plan, progress_bar
from daq_app.cli.errors import EXIT_BAD_INPUT, EXIT_FAILED, print_paragraph, reported, say_other_name
from daq_app.cli.scheduler_option import SchedulerOption
from daq_app.cli.terminal import Console, echo_json
from daq_app.extras import absent
from daq_app.runfile import RunFileError

_NAMED: Final = 6
"""Files that are named; more of them are counted."""

if TYPE_CHECKING:
    from daq_app.campaign.report.collect import Collected
    from daq_app.campaign.report.tables import RestitutionRow


def report(
    folder: Annotated[Path, typer.Argument(help="Folder of the runs.", metavar="DIR")],
    plan_file: Annotated[Path, typer.Option("--plan", help="Campaign file (TOML).")] = DEFAULT_PLAN,
    out: Annotated[Path | None, typer.Option(help="Folder of the report.", show_default="DIR/report")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes.", show_default="all cores")] = None,
    scheduler: SchedulerOption = "",
    bias_runs: Annotated[
        int, typer.Option(min=0, help="Simulated tests behind each method's bias; 0 leaves it out.")
    ] = 6,
    overwrite: Annotated[
        bool,
        typer.Option("--overwrite", help="Write into an --out that holds files."),
    ] = False,
    anew: Annotated[
        bool, typer.Option("--anew", help="Analyse every run anew, whatever is kept beside it.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print Table 4.1 as JSON.")] = False,
) -> None:
    """Analyse every run of a campaign: HTML and PDF report, figures as SVG, every number as CSV.

    An analysis kept beside its run is taken where run, program and options are those it was made with.
    Runs with a bad verdict are shown and left out of the means. Exit code 1 when a run that nobody had
    flagged bad could not be analysed.
    """
    with reported():
        campaign = open_plan(plan_file)
        _require_extra_and_place(out, overwrite=overwrite)
        # Imported here: `--help` should load none of it.
        from daq_app.campaign.report import collect as gathering
        from daq_app.campaign.report.job import write_collected
        from daq_app.rocking.analysis.options import AnalysisOptions

        with progress_bar("analysing") as advance:
            options = AnalysisOptions(bias_runs=bias_runs)
            found = gathering.collect(
                folder.resolve() if scheduler else folder,
                options=options,
                workers=scheduler or workers,
                progress=advance,
                anew=anew,
            )
        tests, failures = found.tests, found.failures
        _tell_what_is_not_in_it(found, folder)
        for failure in failures:
            print_paragraph("Not analysed", f"{failure.test} ({failure.path}): {failure.reason}")
        if not tests:
            print_paragraph("Error", f"no run in {folder} could be analysed; nothing was written")
            raise typer.Exit(EXIT_FAILED)
        target = out or folder / "report"
        written = write_collected(campaign, folder, found, target, at_once=workers != 1)
        page = next(path for path in written.files if path.suffix == ".html")
        say_other_name(target / "report.html", page)
        say_other_name(target / "report.pdf", next(path for path in written.files if path.suffix == ".pdf"))
        _print(written.restitution, found, page, as_json)
    if any(not failure.flagged_bad for failure in failures):
        raise typer.Exit(EXIT_FAILED)


def _require_extra_and_place(out: Path | None, *, overwrite: bool) -> None:
    """End the command where the report could not be made or written: before runs are analysed for it."""
    if needed := absent("report"):
        print_paragraph("Error", needed)
        raise typer.Exit(EXIT_BAD_INPUT)
    if out is not None and not overwrite and out.is_dir() and any(out.iterdir()):
        raise RunFileError(f"{out} holds files", advice="Choose another folder, or say --overwrite.")


def _tell_what_is_not_in_it(found: Collected, folder: Path) -> None:
    """Lost tests, and files of the folder that are no tests, on stderr: nobody should miss them unawares."""
    for test in found.recorded:
        if test.verdict is TestVerdict.LOST:
            print_paragraph("Lost", f"{test.name}: {test.reason}")
    if found.nameless:
        # Machines of a scheduler are given whole paths.
        below = [folder, folder.resolve()]
        names = [
            next((str(path.relative_to(top)) for top in below if path.is_relative_to(top)), str(path))
            for path in found.nameless[:_NAMED]
        ]
        more = len(found.nameless) - len(names)
        told = ", ".join(names) + (f" and {more} more" if more else "")
        print_paragraph(
            "Not in the report",
            f"{told}: no release of a named test, or not readable (`daq-app verify`). `daq-app campaign "
            "assign` gives a run its place",
            style="bold yellow",
        )


def _known(value: float) -> float | None:
    """JSON has no NaN."""
    return None if math.isnan(value) else value


def _print(rows: Sequence[RestitutionRow], found: Collected, page: Path, as_json: bool) -> None:
    if as_json:
        document = [
            {
                "specimen": row.specimen,
                "method": row.method,
                "tests": row.mean.tests,
                "r": row.mean.mean,
                "low95": _known(row.mean.low95),
                "high95": _known(row.mean.high95),
                "scatter": _known(row.mean.scatter),
                "r_corrected": row.corrected.mean,
                "r_corrected_low95": _known(row.corrected.low95),
                "r_corrected_high95": _known(row.corrected.high95),
                "r_max": row.r_max,
                "ratio": row.ratio,
            }
            for row in rows
        ]
        echo_json({"report": str(page), "analyses": found.origin, "table_4_1": document}, indent=1)
        return
    console = Console()
    if not console.is_terminal:
        console = Console(width=120)  # a file or pipe has no width of its own
    table = Table(title="Table 4.1: coefficient of restitution", title_justify="left", box=SIMPLE_HEAD)
    for column in ("wall", "by", "tests", "mean", "95 %", "r/r_max", "corrected", "95 %"):
        table.add_column(column, justify="left" if column in ("wall", "by") else "right", no_wrap=True)
    for row in rows:
        intervals = [
            "" if math.isnan(group.low95) else f"{group.low95:.4f}–{group.high95:.4f}"
            for group in (row.mean, row.corrected)
        ]
        cells = (str(row.mean.tests), f"{row.mean.mean:.4f}", intervals[0], f"{row.ratio:.3f}")
        table.add_row(row.specimen, row.method, *cells, f"{row.corrected.mean:.4f}", intervals[1])
    console.print(table)
    left_out = [test.test for test in found.tests if not test.good]
    if left_out:
        console.print(f"Left out of the means: {', '.join(left_out)}", highlight=False, markup=False)
    console.print(found.origin, highlight=False, markup=False)
    console.print(f"Report: {page}", highlight=False, markup=False, soft_wrap=True)

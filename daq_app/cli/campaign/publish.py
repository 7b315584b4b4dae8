"""`daq-app publish`: a campaign as a folder that a data repository takes as it is."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daq_app.campaign.plan import Campaign
from daq_app.cli.campaign.progress import DEFAULT_PLAN, open_plan, progress_bar
from daq_app.cli.errors import EXIT_FAILED, print_paragraph, reported
from daq_app.cli.scheduler_option import SchedulerOption
from daq_app.cli.terminal import Console, echo
from daq_app.config import ConfigError, Problem
from daq_app.runfile import RunFileError
from daq_app.runfile.durable import write_whole
from daq_app.workers import Workers

if TYPE_CHECKING:
    from daq_app.campaign.publication.fields import Values
    from daq_app.campaign.publication.folder import Source


def register(app: typer.Typer) -> None:
    """Add the command ``publish``."""
    app.command(
        "publish",
        epilog="Example: daq-app publish runs --plan campaign.toml --out costa-2026 --zip",
    )(publish)


def publish(
    folder: Annotated[Path, typer.Argument(help="Folder of the runs.", metavar="DIR")],
    plan_file: Annotated[
        Path, typer.Option("--plan", help="Campaign file (TOML) with the table [publication].")
    ] = DEFAULT_PLAN,
    out: Annotated[Path | None, typer.Option(help="Folder to write.", show_default="DIR-published")] = None,
    as_zip: Annotated[bool, typer.Option("--zip", help="Write a zip file beside the folder too.")] = False,
    check: Annotated[bool, typer.Option("--check", help="Only say what is missing; write nothing.")] = False,
    fields: Annotated[
        bool,
        typer.Option("--fields", help="Only write an empty fields.csv beside the runs, to be filled in."),
    ] = False,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes.", show_default="all cores")] = None,
    scheduler: SchedulerOption = "",
) -> None:
    """Make a folder that a repository takes: data, tables, figures, README, licence, metadata, checksums.

    Samples go as CF netCDF, tables as CSV, metadata as DataCite, RO-Crate and CITATION.cff. Exit code 1 with
    --check where something is missing.
    """
    with reported():
        campaign = open_plan(plan_file)
        # Imported here: `--help` should not load SciPy.
        from daq_app.campaign.publication.folder import sources

        if scheduler:  # its workers do not know where this process stands
            folder = folder.resolve()
        found, left_out = sources(folder)
        if not found:
            raise RunFileError(f"{folder} holds no released test", advice="Give the folder of the runs.")
        names = list(dict.fromkeys(str(source.recorded.name) for source in found))
        if fields:
            _write_template(folder, campaign, names, plan_file)
            return
        values, missing = _checked(campaign, plan_file, folder, names)
        for words in left_out:
            print_paragraph("Left out", words)
        for words in missing:
            print_paragraph("Missing", words)
        if check:
            echo("Nothing is missing." if not missing else f"{len(missing)} things are missing.")
            raise typer.Exit(EXIT_FAILED if missing else 0)
        target = out or folder.with_name(f"{folder.resolve().name}-published")
        target = target.resolve() if scheduler else target
        _make(
            target,
            folder.resolve() if scheduler else folder,
            found,
            left_out,
            campaign,
            values,
            scheduler or workers,
        )
        Console().print(f"{target}: {_tests(len(found))}", highlight=False, markup=False, soft_wrap=True)
        if as_zip:
            made = _zipped(target)
            Console().print(f"{made}: the same, as one file", highlight=False, markup=False, soft_wrap=True)


def _write_template(folder: Path, campaign: Campaign, names: list[str], plan_file: Path) -> None:
    from daq_app.campaign.publication.fields import FIELDS_FILE, fields_template

    path = folder / FIELDS_FILE
    if not campaign.fields:
        right = "Add [[fields]] with name, title, kind and unit"
        raise ConfigError([Problem(str(plan_file), "fields", "the campaign names no fields", right)])
    if path.exists():
        raise RunFileError(f"{path} exists already", advice="Fill it in, or move it away first.")
    write_whole(path, fields_template(campaign.fields, names))
    echo(f"{path}: a row for each test, {_tests(len(names))}")


def _tests(count: int) -> str:
    return "1 test" if count == 1 else f"{count} tests"


def _checked(
    campaign: Campaign, plan_file: Path, folder: Path, names: list[str]
) -> tuple[dict[str, dict[str, str]], list[str]]:
    """Values of the fields, and what is missing but does not stand in the way, in words.

    Raises `ConfigError` for what does: no description at all, no licence page, values that are wrong.
    """
    from daq_app.campaign.description import missing_words
    from daq_app.campaign.publication.fields import read_fields

    missing = missing_words(campaign.publication)
    values, problems = read_fields(folder, campaign.fields, names)
    hard = ("publication", "publication.licence")
    for key, words in missing:
        if key in hard:
            right = "docs/how-to/publish.md has an example"
            problems.insert(0, Problem(str(plan_file), key, words, right))
    if problems:
        raise ConfigError(problems)
    return {test: dict(row) for test, row in values.items()}, [f"{key}: {words}" for key, words in missing]


def _make(
    target: Path,
    folder: Path,
    found: list[Source],
    left_out: list[str],
    campaign: Campaign,
    values: Values,
    workers: Workers,
) -> None:
    """Write beside the name and rename: an interrupted publication leaves no half of one."""
    from daq_app.campaign.publication.folder import publish as write_folder
    from daq_app.cli.analyse.derived import derived_of

    if target.exists():
        raise RunFileError(f"{target} exists already", advice="Name a folder that does not exist yet.")
    beside = target.with_name(f"{target.name}.part")
    shutil.rmtree(beside, ignore_errors=True)
    try:
        with progress_bar("publishing") as advance:
            write_folder(
                found,
                left_out,
                campaign,
                values,
                beside,
                derive=derived_of,
                draw=lambda place: _report(place, folder, campaign, workers),
                workers=workers,
                progress=advance,
            )
        beside.replace(target)
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _report(place: Path, folder: Path, campaign: Campaign, workers: Workers) -> None:
    """The campaign report with its figures; left out where no test can be analysed."""
    from daq_app.campaign.report.collect import collect
    from daq_app.campaign.report.write import write_report
    from daq_app.campaign.status import CampaignStatus

    found = collect(folder, workers=workers)
    if found.tests:
        status = CampaignStatus(campaign, found.recorded)
        write_report(place, campaign.name, status, found.tests, failures=found.failures, at_once=workers != 1)


def _zipped(target: Path) -> Path:
    made = target.with_name(f"{target.name}.zip")
    if made.exists():
        raise RunFileError(f"{made} exists already", advice="Move it away, or choose another --out.")
    beside = target.with_name(f"{target.name}.part")
    written = Path(shutil.make_archive(str(beside), "zip", root_dir=target.parent, base_dir=target.name))
    written.replace(made)
    return made

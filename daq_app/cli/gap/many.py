"""`daq-app gap campaigns`: the diagnosis of every specimen of many campaign folders."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from daq_app.cli.campaign.progress import progress_bar
from daq_app.cli.errors import EXIT_FAILED, print_paragraph, reported
from daq_app.cli.scheduler_option import SchedulerOption
from daq_app.cli.terminal import Console
from daq_app.config import load_rig
from daq_app.runfile import RunFileError
from daq_app.runfile.durable import write_whole
from daq_app.runfile.folder import require_replaceable

if TYPE_CHECKING:
    from daq_app.gap.many import Diagnosed, Specimen


def campaigns(
    folders: Annotated[
        list[Path],
        typer.Argument(help="Campaign folders; each specimen is diagnosed by itself.", metavar="DIR…"),
    ],
    out: Annotated[Path, typer.Option("--out", help="Folder of the results (made if need be).")],
    rig: Annotated[
        Path | None, typer.Option(help="Rig file to compare with; the one kept in each run if left out.")
    ] = None,
    causes: Annotated[
        int, typer.Option(min=1, max=3, help="The largest number of causes that are sought together.")
    ] = 3,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes.", show_default="all cores")] = None,
    scheduler: SchedulerOption = "",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace results that are there.")] = False,
) -> None:
    """Diagnose the specimens of many campaigns side by side; each result is a JSON file.

    The file is the one that `gap diagnose --json` writes. Tests that were rejected or failed their check are
    left out. Exit code 1 when a specimen could not be diagnosed; the others are written all the same.
    """
    with reported():
        from daq_app.gap.many import diagnose_all, specimens_of
        from daq_app.workers import warm_up

        replacement = load_rig(rig) if rig is not None else None
        # The workers of a scheduler stand elsewhere: no path may be relative.
        found = [one for folder in folders for one in specimens_of(folder.resolve())]
        _require_names_apart(found)
        for specimen in found:
            require_replaceable(_file_of(specimen, out), overwrite=overwrite)
        if not found:
            raise RunFileError("no named test in these folders", advice="Give folders that hold runs.")
        out.mkdir(parents=True, exist_ok=True)
        if not scheduler:
            warm_up("daq_app.gap.rocking_model.study")
        with progress_bar("diagnosing") as advance:
            answers = diagnose_all(
                found,
                rig=replacement,
                causes=causes,
                workers=scheduler or workers,
                done=lambda number, specimen: advance(number, len(found), specimen.title),
            )
        for answer in answers:
            if answer.document:
                write_whole(_file_of(answer.specimen, out), answer.document)
    _print(answers, out)
    if not all(answer.document for answer in answers):
        raise typer.Exit(EXIT_FAILED)


def _file_of(specimen: Specimen, out: Path) -> Path:
    return out / f"{specimen.title}.json"


def _require_names_apart(found: Sequence[Specimen]) -> None:
    twice = [title for title, number in Counter(one.title for one in found).items() if number > 1]
    if twice:
        raise RunFileError(
            f"two results would be called {twice[0]}.json", advice="Diagnose folders of one name one by one."
        )


def _print(answers: Sequence[Diagnosed], out: Path) -> None:
    table = Table("campaign and specimen", "tests", "left out", "answer")
    for answer in answers:
        specimen = answer.specimen
        words = f"{answer.verdict}: {answer.sentence}" if answer.document else "not diagnosed"
        table.add_row(specimen.title, str(len(specimen.runs)), str(len(specimen.left_out)), words)
    console = Console()
    console.print(table)
    for answer in answers:
        if not answer.document:
            print_paragraph("Not diagnosed", f"{answer.specimen.title}: {answer.sentence}")
    written = sum(bool(answer.document) for answer in answers)
    console.print(f"{written} of {len(answers)} results written to {out}.", markup=False, soft_wrap=True)

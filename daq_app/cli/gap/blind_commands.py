"""`daq-app gap blind`: make sealed cases, diagnose them without their labels, score."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from daq_app.cli.errors import EXIT_BAD_INPUT, EXIT_FAILED, print_paragraph, reported
from daq_app.cli.help_page import command_group
from daq_app.cli.scheduler_option import SchedulerOption
from daq_app.cli.terminal import Console, echo
from daq_app.config import load_rig
from daq_app.config.shipped import here_or_shipped
from daq_app.runfile.durable import write_whole
from daq_app.runfile.folder import require_replaceable

if TYPE_CHECKING:
    from daq_app.gap.blind.scoring.score import LaboratoryScore, Score

_RIGS = (Path("configs/fr1.toml"), Path("configs/fr2.toml"))
_PRODUCT = "daq_app.gap.blind.running.diagnosers:product"
_LabelsOption = Annotated[
    Path | None, typer.Option(help="Folder of the labels; beside the cases, as DIR-labels, if left out.")
]
_EngineOption = Annotated[
    Literal["events", "contact"] | None,
    typer.Option(help="What moves the wall: own equations or a contact engine; else the laboratory's."),
]
_LaboratoryOption = Annotated[
    str, typer.Option(help="Whose ordinary imperfections: own, ordinary, rough, contact or one for judging.")
]
_AloneOption = Annotated[str, typer.Option(help="Switch on only this imperfection of the laboratory.")]
_HiddenOption = Annotated[str, typer.Option(help="Effect that every case hides, or `nothing`; else a mix.")]
_ResultsOption = Annotated[
    str, typer.Option(help="Folder of the results within DIR, so that several diagnoses keep their own.")
]
_WorkersOption = Annotated[int, typer.Option(min=0, help="Processes; 0 takes one for each core.")]


def register(app: typer.Typer) -> None:
    """Add the group ``blind`` to the group ``gap``, which is made if nobody made it."""
    blind = command_group("Check the diagnosis on cases whose cause it is not told.")
    blind.command(
        "make", epilog="Example: daq-app gap blind make --cases 200 --seed 1 --out check --labels kept/check"
    )(make)
    blind.command("run", epilog="Example: daq-app gap blind run check")(run)
    blind.command(
        "score", epilog="Example: daq-app gap blind score check --labels kept/check --html check.html"
    )(score)
    blind.command("table", epilog="Example: daq-app gap blind table ordinary rough contact")(table)
    group = next((g.typer_instance for g in app.registered_groups if g.name == "gap"), None)
    if group is None:
        group = command_group("The gap between simulator and recordings.")
        app.add_typer(group, name="gap")
    group.add_typer(blind, name="blind")


@contextmanager
def _refusals() -> Iterator[None]:
    """Broken seals, missing diagnosers and engines are told in one paragraph."""
    from daq_app.gap.blind.running.diagnosers import DiagnoserError
    from daq_app.gap.blind.seal import SealBroken
    from daq_app.gap.blind.world.contact.motion import EngineMissing

    with reported():
        try:
            yield
        except (DiagnoserError, EngineMissing, ValueError) as error:
            print_paragraph("Error", str(error))
            raise typer.Exit(EXIT_BAD_INPUT) from None
        except SealBroken as error:
            print_paragraph("Seal broken", str(error))
            raise typer.Exit(EXIT_FAILED) from None


def make(
    out: Annotated[Path, typer.Option(help="Folder of the cases.")],
    cases: Annotated[int, typer.Option(min=1, max=100_000, help="How many cases.")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="Keep it from whoever diagnoses.")] = 1,
    labels: _LabelsOption = None,
    rig: Annotated[list[Path] | None, typer.Option(help="Rig files; the cases take turns.")] = None,
    runs: Annotated[int, typer.Option(min=1, max=36, help="Runs in each case.")] = 6,
    engine: _EngineOption = None,
    laboratory: _LaboratoryOption = "own",
    alone: _AloneOption = "",
    hidden: _HiddenOption = "",
    workers: _WorkersOption = 0,
) -> None:
    """Simulate release tests with hidden effects, and seal their labels. An interrupted making goes on.

    With --engine contact MuJoCo moves the wall (extra: contact) and effects are of the feet it stands on.
    """
    from daq_app.gap.blind.making.make import Order, check_apart, make_cases

    with _refusals():
        kept = labels or _beside(out)
        check_apart(out, kept)
        files = rig or [here_or_shipped(path) for path in _RIGS]
        for file in files:
            load_rig(file)
        texts = tuple(file.read_text(encoding="utf-8") for file in files)
        order = Order(seed, out, kept, texts, runs, engine, laboratory, alone, hidden)
        with _progress("making", cases) as advance:
            before = sum((out / f"case_{k + 1:04d}" / "seal.json").exists() for k in range(cases))
            advance(before)
            make_cases(order, range(cases), _workers(workers), lambda _count, _index: advance(1))
        echo(f"{cases} sealed cases in {out}; labels in {kept}: keep them away from the diagnosis")


def run(
    folder: Annotated[Path, typer.Argument(help="Folder of the cases.", metavar="DIR")],
    diagnoser: Annotated[str, typer.Option(help="module:function that diagnoses a case.")] = _PRODUCT,
    scheduler: SchedulerOption = "",
    results: _ResultsOption = "results",
    workers: _WorkersOption = 0,
    timeout: Annotated[float, typer.Option(min=1, help="Longest time for one case, seconds.")] = 1800.0,
) -> None:
    """Diagnose every case in a process that has nothing but its files. Goes on where it was interrupted."""
    from daq_app.gap.blind.running.diagnosers import load_diagnoser
    from daq_app.gap.blind.running.runner import case_folders, pending, run_on_scheduler, run_pending

    with _refusals():
        load_diagnoser(diagnoser)
        total, todo = len(case_folders(folder)), len(pending(folder, diagnoser, results))
        if total == 0:
            raise ValueError(f"{folder} holds no sealed cases. Make some: daq-app gap blind make --out DIR")
        outcomes = (
            run_on_scheduler(folder, diagnoser, scheduler, timeout, results)
            if scheduler
            else run_pending(folder, diagnoser, _workers(workers), timeout, results)
        )
        failed = 0
        with _progress("diagnosing", total) as advance:
            advance(total - todo)
            for outcome in outcomes:
                advance(1)
                if outcome.failure:
                    failed += 1
                    print_paragraph(outcome.case, outcome.failure, style="bold yellow")
        echo(f"{total} cases, {todo} diagnosed now, {failed} of them without a result")
        if failed:
            raise typer.Exit(EXIT_FAILED)


def score(
    folder: Annotated[Path, typer.Argument(help="Folder of the cases.", metavar="DIR")],
    labels: _LabelsOption = None,
    results: _ResultsOption = "results",
    html: Annotated[Path | None, typer.Option(help="Write a page with pictures.")] = None,
    page: Annotated[Path | None, typer.Option(help="The same as Markdown, pictures in images/.")] = None,
    json_out: Annotated[Path | None, typer.Option("--json", help="Write all numbers as JSON.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files that are there.")] = False,
) -> None:
    """Open the labels, check the seals, say how good the diagnosis is. Exit code 1: a target is missed."""
    from daq_app.gap.blind.scoring.score import score_folder

    with _refusals():
        for written in filter(None, (html, page, json_out)):
            require_replaceable(written, overwrite=overwrite)
        found = score_folder(folder, labels or _beside(folder), results)
        _print_score(found)
        if json_out:
            write_whole(json_out, json.dumps(found.to_dict(), ensure_ascii=False, indent=1))
        if html:
            from daq_app.gap.blind.scoring.report import write_report

            write_report(found, html)
        if page:
            from daq_app.gap.blind.scoring.report import write_markdown

            write_markdown(found, page)
        if not found.passed:
            raise typer.Exit(EXIT_FAILED)


def table(
    folders: Annotated[list[Path], typer.Argument(help="Folders of cases, labels beside.", metavar="DIR…")],
    results: _ResultsOption = "results",
    misses: Annotated[bool, typer.Option("--misses", help="Also list what was not right.")] = False,
) -> None:
    """Scores of all cases that have a result, a column for each laboratory. Always exit code 0."""
    from daq_app.gap.blind.scoring.score import by_laboratory, score_folder

    with _refusals():
        scores = [score_folder(folder, _beside(folder), results) for folder in folders]
    judged = [one for score in scores for one in score.judged]
    console = Console()
    console.print(_laboratory_table(by_laboratory(judged)))
    if misses:
        for one in judged:
            if not one.answered_rightly:
                answer = f"{one.decision} {' + '.join(one.named)}, p = {one.claimed:.3f}"
                truth = " + ".join(one.truth) or "nothing"
                console.print(f"{one.laboratory} {one.case}: {truth} ({one.strength:.1f} sd) → {answer}")
    waiting = sum(len(score.waiting) for score in scores)
    if waiting:
        console.print(f"{waiting} cases have no result yet")


_SIDE_BY_SIDE = 6
"""Laboratories that stand beside each other; more are a line each, with fewer scores."""
_IN_A_LINE = ("decisions right", "singles", "nothing", "wrong at p > 0.95", "closure ≥ 0.9")


def _laboratory_table(rows: list[LaboratoryScore]) -> Table:
    if len(rows) > _SIDE_BY_SIDE:
        shown = Table("laboratory", *_IN_A_LINE)
        for row in rows:
            shown.add_row(f"{row.laboratory} ({row.cases})", *(row.columns.get(n, "–") for n in _IN_A_LINE))
        return shown
    shown = Table("score", *(f"{row.laboratory} ({row.cases})" for row in rows))
    for name in dict.fromkeys(name for row in rows for name in row.columns):
        shown.add_row(name, *(row.columns.get(name, "–") for row in rows))
    return shown


def _print_score(found: Score) -> None:
    console = Console()
    table = Table(title=f"Blind check: {len(found.judged)} cases", title_justify="left")
    for column in ("score", "found", "95 % interval", "cases", "target", ""):
        table.add_column(column, overflow="fold")
    for row in found.rows:
        verdict = {True: "met", False: "missed", None: ""}[row.met]
        table.add_row(*row.cells, verdict)
    console.print(table)
    _print_confusion(found, console)
    if found.waiting:
        console.print(f"{len(found.waiting)} cases have no result yet: daq-app gap blind run goes on")


def _print_confusion(found: Score, console: Console) -> None:
    """What was hidden → what was answered, most frequent first; the matrix is in the HTML page."""
    from daq_app.gap.blind.scoring.score import confusion

    counts = confusion(found.judged)
    table = Table(title="Hidden and answered", title_justify="left")
    for column in ("hidden", "answers (cases)"):
        table.add_column(column, overflow="fold")
    for truth in sorted({hidden for hidden, _ in counts}):
        answers = sorted(
            ((n, answer) for (hidden, answer), n in counts.items() if hidden == truth),
            key=lambda pair: (-pair[0], pair[1]),
        )
        table.add_row(truth, ", ".join(f"{answer} {n}" for n, answer in answers))
    console.print(table)


@contextmanager
def _progress(what: str, total: int) -> Iterator[Callable[[int], None]]:
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task(what, total=total)
        yield lambda n: progress.advance(task, n)


def _beside(folder: Path) -> Path:
    return folder.with_name(f"{folder.name}-labels")


def _workers(asked: int) -> int:
    return asked or os.cpu_count() or 1

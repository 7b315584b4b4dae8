"""`daq-app gap diagnose`, `gap starter`, `gap effects` and `gap apply`; the group of all gap commands."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import BarColumn, TextColumn
from rich.table import Table

from daq_app.cli.errors import (
    EXIT_BAD_INPUT,
    EXIT_FAILED,
    EXIT_INTERRUPTED,
    print_paragraph,
    reported,
    say_other_name,
)
from daq_app.cli.gap.many import campaigns
from daq_app.cli.help_page import command_group
from daq_app.cli.terminal import Console, echo, echo_json, progress_on_stderr
from daq_app.config import load_rig
from daq_app.runfile.durable import write_whole
from daq_app.runfile.folder import require_replaceable

if TYPE_CHECKING:
    from daq_app.gap.core import Diagnosis, Options
    from daq_app.gap.rocking_model.records import GapRun


def register(app: typer.Typer) -> None:
    """Add the group ``gap``."""
    group = command_group(
        "Where simulator and recordings differ, which effect explains it, how far it shrinks."
    )
    group.command(
        "diagnose",
        epilog="Example: daq-app gap diagnose FR1-*.h5 --rig fr1.toml --report gap.html --json gap.json",
    )(diagnose)
    group.command("campaigns", epilog="Example: daq-app gap campaigns march-runs april-runs --out diagnoses")(
        campaigns
    )
    group.command("starter", epilog="Example: daq-app gap starter my_model.py")(starter)
    group.command("effects", epilog="Example: daq-app gap effects --family dissipation")(effects)
    group.command(
        "apply",
        epilog="Example: daq-app gap apply gap.json --rig configs/fr1.toml --out fr1-with-effect.toml",
    )(apply)
    app.add_typer(group, name="gap")


@contextmanager
def _refusals() -> Iterator[None]:
    """A refusal to diagnose is bad input, said in one paragraph."""
    from daq_app.gap.core import CannotDiagnose

    with reported():
        try:
            yield
        except CannotDiagnose as refusal:
            print_paragraph("Cannot diagnose", str(refusal))
            raise typer.Exit(EXIT_BAD_INPUT) from None


def diagnose(
    runs: Annotated[
        list[Path],
        typer.Argument(help="Run files (HDF5) of one specimen; with --model any recordings.", metavar="RUN…"),
    ],
    model: Annotated[
        Path | None, typer.Option(help="Python file with a simulator and effects of one's own.")
    ] = None,
    rig: Annotated[
        Path | None, typer.Option(help="Rig file to compare with; the one kept in each run if left out.")
    ] = None,
    report: Annotated[Path | None, typer.Option(help="Write a one-page report: HTML, and a PDF.")] = None,
    json_out: Annotated[Path | None, typer.Option("--json", help="Write the whole result as JSON.")] = None,
    causes: Annotated[
        int, typer.Option(min=1, max=3, help="The largest number of causes that are sought together.")
    ] = 3,
    hold_out: Annotated[
        str, typer.Option(help="What is held out to measure the gap: level or repetition.")
    ] = "level",
    cores: Annotated[int, typer.Option(min=0, help="Processes; 0 takes all cores.")] = 0,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files that are there.")] = False,
) -> None:
    """Say where simulator and runs differ, which missing effect explains it, and how far the gap shrinks.

    With --model the simulator and the recordings are one's own (docs/how-to/own-model.md).

    Exit code 0 when an effect, a pair, parameters or nothing missing was found; 1 when the answer is
    that it cannot be told, none of these, or below detection; 2 for input that cannot be diagnosed.
    """
    if hold_out not in ("level", "repetition"):
        raise _bad_input(f"--hold-out is level or repetition, not {hold_out}.")
    if model is not None and rig is not None:
        raise _bad_input("--rig describes a rocking wall; with --model the model file says what is known.")
    asked = _Asked(causes, hold_out, cores or os.cpu_count() or 1)
    with _refusals():
        read = [*runs, *filter(None, (rig, model))]
        for written in (json_out, report, report and report.with_suffix(".pdf")):
            if written is not None:
                require_replaceable(written, read, overwrite=overwrite)
        result, loaded = (
            _diagnose_own(model, runs, asked) if model is not None else _diagnose_walls(runs, rig, asked)
        )
        if json_out is not None:
            write_whole(json_out, result.to_json())
        if report is not None:
            from daq_app.gap.report import write_report

            page, document = write_report(result, report, loaded)
            say_other_name(report, page)
            say_other_name(report.with_suffix(".pdf"), document)
    _print(result)
    good = result.decision.verdict in ("effect", "pair", "several", "parameters", "nothing_missing")
    raise typer.Exit(0 if good else EXIT_FAILED)


@dataclass(frozen=True)
class _Asked:
    """What the options of `diagnose` ask for."""

    causes: int
    hold_out: str
    workers: int


def _diagnose_walls(paths: list[Path], rig: Path | None, asked: _Asked) -> tuple[Diagnosis, list[GapRun]]:
    from daq_app.workers import warm_up

    if asked.workers > 1:  # while this process imports and reads the files
        warm_up("daq_app.gap.rocking_model.prediction.preloaded")
    from daq_app.gap.rocking_model.records import load_run
    from daq_app.gap.rocking_model.study import diagnose_runs

    replacement = load_rig(rig) if rig is not None else None
    loaded = [load_run(path, replacement) for path in paths]
    with _options(asked) as options:
        return diagnose_runs(loaded, options), loaded


def _diagnose_own(model: Path, recordings: list[Path], asked: _Asked) -> tuple[Diagnosis, list[GapRun]]:
    from daq_app.gap.own_model.study import diagnose_own

    with _options(asked) as options:
        return diagnose_own(model, recordings, options), []


@contextmanager
def _options(asked: _Asked) -> Iterator[Options]:
    """Options that show their progress; an interrupt ends the command in words."""
    from daq_app.gap.core import Options
    from daq_app.gap.core.fitting.parallel import Interrupted

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.completed}/{task.total}"),
    )
    with progress_on_stderr(*columns) as progress:
        bar = progress.add_task("reading features", total=1)

        def show(done: int, total: int, text: str) -> None:
            progress.update(bar, description=text, completed=done, total=total)

        try:
            yield Options(causes=asked.causes, hold_out=asked.hold_out, workers=asked.workers, progress=show)
        except (KeyboardInterrupt, Interrupted):
            print_paragraph("Interrupted", "the diagnosis was stopped; nothing was written")
            raise typer.Exit(EXIT_INTERRUPTED) from None


def _bad_input(words: str) -> typer.Exit:
    print_paragraph("Error", words)
    return typer.Exit(EXIT_BAD_INPUT)


def starter(
    out: Annotated[
        Path, typer.Argument(help="Model file to write, for instance my_model.py.", metavar="FILE")
    ],
) -> None:
    """Write a model file to begin with: a bouncing ball, to be changed into what is yours.

    Exit code 0; 2 where the file is there already or cannot be written.
    """
    from importlib.resources import files

    text = files("daq_app.gap.own_model").joinpath("starter.py").read_text(encoding="utf-8")
    if out.exists():
        raise _bad_input(f"{out} is there already. Give another name.")
    try:
        write_whole(out, text)
    except OSError as error:
        raise _bad_input(f"{out} cannot be written: {error.strerror}.") from None
    echo(f"{out} written. Try it: daq-app gap diagnose --model {out} RECORDING…")


def _print(result: Diagnosis) -> None:
    from daq_app.gap.words import cause_in_words

    console = Console()
    console.print(f"{result.decision.verdict}: {result.decision.sentence}", markup=False)
    console.print(f"Where: {result.where.sentence}", markup=False)
    table = Table("hypothesis", "family", "probability", "log evidence")
    for entry in result.which[:6]:
        table.add_row(
            result.in_words(entry.effects),
            entry.family,
            f"{entry.probability:.3f}",
            f"{entry.log_evidence:.1f}",
        )
    console.print(table)
    estimates = Table("parameter", "value", "95 % interval", "unit")
    for estimate in (*result.effect_parameters, *result.parameters[:4]):
        interval = f"{estimate.low:.4g} … {estimate.high:.4g}"
        estimates.add_row(estimate.name, f"{estimate.value:.4g}", interval, estimate.unit)
    console.print(estimates)
    if result.gap is not None:
        console.print(
            f"Gap on held-out runs, in units of noise and scatter: {result.gap.before:.2f} → "
            f"{result.gap.after:.2f} (floor {result.gap.floor:.1f}); closure {result.gap.closure:.2f}."
        )
    for cause in result.causes:
        closes = f", closes {100 * cause.closes:.0f} % alone" if cause.closes == cause.closes else ""
        sizes = {e.name: (e.value, e.low, e.high) for e in cause.estimates}
        words = cause_in_words(cause.name, sizes, cause.words)
        console.print(f"Cause ({cause.probability:.2f}{closes}): {words}", markup=False)
    for finding in result.findings:
        weight = "material" if finding.material else "ordinary"
        what = "Instrument" if finding.family == "sensor" else "Surroundings"
        console.print(f"{what} ({weight}): {finding.words}", markup=False)
    console.print(f"What remains: {result.rest.words}.", markup=False)
    console.print(f"Next: {result.next_measurement}", markup=False)
    for limit in result.limits:
        console.print(f"Limit: {limit}", markup=False)


def effects(
    family: Annotated[str | None, typer.Option(help="Only effects of this family.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the library as JSON.")] = False,
) -> None:
    """List the effects that a diagnosis knows: equation, parameters, reference, what it is confusable with.

    Exit code 0; 2 for a family that does not exist.
    """

    from daq_app.gap.rocking_model.library import rocking_library

    library = rocking_library()
    chosen = [e for e in library.values() if family in (None, e.family)]
    if not chosen:
        print_paragraph("Error", f"there is no family {family}; there are {', '.join(library.families)}")
        raise typer.Exit(EXIT_BAD_INPUT)
    if as_json:
        listed = [
            {
                "name": e.name,
                "family": e.family,
                "kind": e.kind,
                "equation": e.equation,
                "reference": e.reference,
                "signature": e.signature,
                "parameters": [
                    {
                        "name": p.name,
                        "unit": p.unit,
                        "meaning": p.meaning,
                        "prior_sd": p.sd,
                        "per_run": p.per_run,
                    }
                    for p in e.parameters
                ],
                "confusable_with": [{"effect": c.effect, "measure": c.measure} for c in e.confusable_with],
            }
            for e in chosen
        ]
        echo_json(listed, indent=1)
        return
    table = Table("effect", "family", "adds", "parameters", "confusable with", "source")
    for e in chosen:
        table.add_row(
            e.name if e.kind == "effect" else f"{e.name} ({e.kind})",
            e.family,
            e.equation,
            ", ".join(f"{p.name} ({p.unit})" if p.unit else p.name for p in e.parameters),
            ", ".join(dict.fromkeys(c.effect for c in e.confusable_with)),
            e.reference,
        )
    Console().print(table)


def apply(
    result: Annotated[Path, typer.Argument(help="Result of `gap diagnose --json`.", metavar="RESULT")],
    rig: Annotated[Path, typer.Option(help="Rig file to start from.")],
    out: Annotated[Path, typer.Option(help="Rig file to write.")],
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a file that is there.")] = False,
) -> None:
    """Write a rig file whose simulated wall has the parameters and the effect that a diagnosis found.

    Exit code 0; 2 where the result names no effect or a file cannot be used.
    """
    from daq_app.gap.apply import apply_result, read_result

    with _refusals():
        found = apply_result(read_result(result), rig, out, overwrite=overwrite)
    console = Console()
    for name, values in found.items():
        written = ", ".join(f"{key} = {value:.5g}" for key, value in values.items())
        console.print(f"{name}: {written}", markup=False)
    console.print(f"Written to {out}.", markup=False, soft_wrap=True)

"""`daq-app import`: recordings of other programs into runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from daq_app.cli.campaign.progress import progress_bar
from daq_app.cli.errors import EXIT_FAILED, print_paragraph, reported
from daq_app.cli.runs.output_place import file_or_folder
from daq_app.cli.scheduler_option import SchedulerOption
from daq_app.cli.terminal import Console, echo, echo_json
from daq_app.config import ConfigError, Rig, parse_rig
from daq_app.config.toml_file import read_text
from daq_app.runfile import DerivedData, RunFileError
from daq_app.runfile.importers import ImportMap, ImportReport, import_file, load_import_map, propose_map
from daq_app.runfile.source import RunSource
from daq_app.workers import Workers, run_all

_Answer = ImportReport | RunFileError | ConfigError


def register(app: typer.Typer) -> None:
    """Add the command to the root."""
    app.command(
        "import",
        epilog="Example: daq-app import old/test7.lvm --rig configs/fr1.toml --map old/map.toml --out runs",
    )(import_command)


def import_command(
    files: Annotated[list[Path], typer.Argument(help="TDMS, LVM, CSV, MAT or NPZ files.", metavar="FILE…")],
    rig: Annotated[Path, typer.Option("--rig", help="Rig file of the tests.")],
    map_: Annotated[
        Path | None,
        typer.Option("--map", help="Which column is which channel (TOML); without it, names must agree."),
    ] = None,
    out: Annotated[
        Path,
        typer.Option("--out", help="Folder of runs (made if need be), or the run file, named with .h5."),
    ] = Path(),
    workers: Annotated[int | None, typer.Option(min=1, help="Processes.", show_default="all cores")] = None,
    scheduler: SchedulerOption = "",
    propose: Annotated[
        bool,
        typer.Option(
            "--propose-map", help="Import nothing; print a map for the first file, guessed from its contents."
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object for each file.")] = False,
) -> None:
    """Turn recordings of another program into runs.

    What a file says that cannot be true (units, increments, lengths) is reported and not believed;
    where it matters, the import is refused and says what to put into the map. One file that is refused
    does not stop the others.
    """
    with reported():
        rig_text = read_text(rig)
        import_map = load_import_map(map_) if map_ else ImportMap()
        parsed = parse_rig(rig_text, str(rig))
        if propose:
            with Console(stderr=True).status(f"comparing {files[0].name} with {parsed.name} …"):
                proposal = propose_map(files[0], parsed, import_map.source)
            for line in proposal.text(files[0].name).splitlines():
                echo(line)
            return
        _require_a_name_for_each(files, out, map_, import_map)
        with file_or_folder(out) as place, progress_bar("importing") as advance:
            answers = _import_all(
                files,
                partial(
                    _imported, rig=parsed, rig_text=rig_text, out=place.absolute(), import_map=import_map
                ),
                scheduler or workers,
                lambda number, file: advance(number, len(files), file.name),
            )
            if not any(isinstance(answer, ImportReport) for answer in answers):
                _say_refusals(answers)
    for answer in answers:
        if isinstance(answer, ImportReport):
            _print_import(answer, as_json)
    _say_refusals(answers)


def _require_a_name_for_each(
    files: Sequence[Path], out: Path, map_: Path | None, import_map: ImportMap
) -> None:
    if len(files) > 1 and import_map.run.test:
        raise RunFileError(
            f"{map_} names the test {import_map.run.test}, and {len(files)} files are given",
            advice="Leave `test` out: each run is then called as its file.",
        )
    if len(files) > 1 and out.suffix:
        raise RunFileError(f"{out} is one file, and {len(files)} are given", advice="Name a folder.")
    of_stem: dict[str, Path] = {}
    for file in files:
        other = of_stem.setdefault(file.stem.casefold(), file)
        if other is not file:
            raise RunFileError(
                f"{other} and {file} would both become {file.stem}.h5", advice="Import them into two folders."
            )


def _import_all(
    files: Sequence[Path],
    work: Callable[[Path], _Answer],
    workers: Workers,
    done: Callable[[int, Path], None],
) -> list[_Answer]:
    """One file needs no other process; the workers of a scheduler stand in folders of their own."""
    if len(files) == 1 and not isinstance(workers, str):
        return [work(files[0])]
    return run_all(work, [file.absolute() for file in files], workers, done)


def _imported(path: Path, *, rig: Rig, rig_text: str, out: Path, import_map: ImportMap) -> _Answer:
    try:
        return import_file(path, rig, rig_text, out, import_map, _derived)
    except (RunFileError, ConfigError) as refusal:
        return refusal


def _derived(run: RunSource) -> DerivedData | None:
    from daq_app.acquisition.closing.derive import derive_imported  # loads the analysis

    return derive_imported(run)


def _say_refusals(answers: Sequence[_Answer]) -> None:
    """A paragraph for each file that was refused. Raises `typer.Exit` where there is one."""
    refusals = [answer for answer in answers if not isinstance(answer, ImportReport)]
    for refusal in refusals:
        try:
            with reported():
                raise refusal
        except typer.Exit:
            if len(answers) == 1:
                raise
    if refusals:
        print_paragraph("Incomplete", f"{len(refusals)} of {len(answers)} files were not imported")
        raise typer.Exit(EXIT_FAILED)


def _print_import(report: ImportReport, as_json: bool) -> None:
    if as_json:
        document = {
            "run": str(report.run),
            "n_samples": report.n_samples,
            "rate_hz": report.rate_hz,
            "channels": list(report.channel_ids),
            "doubts": list(report.doubts),
            "quality": dict(report.quality) or None,
        }
        echo_json(document)
        return
    for doubt in report.doubts:
        print_paragraph("Doubtful", doubt, style="bold yellow")
    size = f"{len(report.channel_ids)} channels, {report.n_samples} samples at {report.rate_hz:g} Hz"
    echo(f"{report.run}: {size}")
    if report.quality:
        echo("Verdict: " + "; ".join([report.quality["verdict"], *report.quality["reasons"]]))

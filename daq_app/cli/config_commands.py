"""`daq-app config check`, `show` and `templates`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from daq_app.cli.config_tables import plan_tables
from daq_app.cli.devices import devices_of
from daq_app.cli.errors import EXIT_BAD_INPUT, print_paragraph, print_problems, reported
from daq_app.cli.help_page import command_group
from daq_app.cli.terminal import Console, echo, echo_json
from daq_app.config import ConfigError, load_rig, plan_tasks
from daq_app.config.hardware.comparison import differences
from daq_app.config.hardware.max_file import ListedDevice
from daq_app.config.shipped import copy_shipped


def register(app: typer.Typer) -> None:
    """Add the group ``config``."""
    group = command_group("Check, show and copy rig files.")
    group.command("check", epilog="Example: daq-app config check configs/fr1.toml configs/fr2.toml")(check)
    group.command("show", epilog="Example: daq-app config show configs/fr1-iepe.toml")(show)
    group.command("templates", epilog="Example: daq-app config templates configs")(templates)
    app.add_typer(group, name="config")


def check(
    files: Annotated[list[Path], typer.Argument(help="Rig files (TOML).", metavar="FILE…")],
    against: Annotated[
        str | None,
        typer.Option(metavar="EXPORT.ini|CONNECTION", help="Compare with the devices that are there."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object per file.")] = False,
) -> None:
    """Say of each rig file whether it can be used, with every problem in it and every note.

    With --against also what differs from an export of NI MAX, or from the devices at local,
    grpc://HOST:PORT or grpcs://HOST:PORT.
    Exit code 0 if all files are good, 2 if one is not.
    """
    bad = 0
    with reported():
        there = devices_of(against) if against is not None else None
        for file in files:
            good = _check_json(file, there) if as_json else _check_text(file, there)
            bad += not good
    raise typer.Exit(EXIT_BAD_INPUT if bad else 0)


def _check_text(file: Path, there: list[ListedDevice] | None) -> bool:
    try:
        rig = load_rig(file)
        plan = plan_tasks(rig, str(file))
    except ConfigError as error:
        print_problems(error.problems)
        return False
    Console().print(
        f"{file}: good. {len(rig.channels)} channels in {len(plan.tasks)} task(s) at {plan.rate_hz:.2f} Hz",
        highlight=False,
        markup=False,
        soft_wrap=True,
    )
    for note in plan.notes:
        if note.severity == "warning":
            print_paragraph("Warning", f"{file}: {note.where}: {note.text}", style="bold yellow")
        elif note.where == "hardware.chassis":
            print_paragraph("Note", f"{file}: {note.text}", style="bold")
    wrong = [] if there is None else differences(rig.hardware, there)
    for sentence in wrong:
        print_paragraph("Error", f"{file}: {sentence}")
    if there is not None and not wrong:
        echo(f"{file}: its hardware is there")
    return not wrong


def _check_json(file: Path, there: list[ListedDevice] | None) -> bool:
    result: dict[str, object] = {"file": str(file), "good": True, "problems": [], "notes": []}
    try:
        rig = load_rig(file)
        plan = plan_tasks(rig, str(file))
        result |= {
            "name": rig.name,
            "channels": len(rig.channels),
            "rate_hz": plan.rate_hz,
            "tasks": [
                {"name": task.name, "role": task.role, "channels": [p.channel.id for p in task.channels]}
                for task in plan.tasks
            ],
            "notes": [
                {"severity": note.severity, "where": note.where, "text": note.text} for note in plan.notes
            ],
        }
        if there is not None:
            wrong = differences(rig.hardware, there)
            result |= {"good": not wrong, "differences": wrong}
    except ConfigError as error:
        result["good"] = False
        result["problems"] = [{"key": p.key, "wrong": p.wrong, "right": p.right} for p in error.problems]
    echo_json(result)
    return bool(result["good"])


def show(file: Annotated[Path, typer.Argument(help="Rig file (TOML).")]) -> None:
    """Show a rig: its sensors, NI tasks, rates, skews and delays, load of each module, notes."""
    with reported():
        rig = load_rig(file)
        plan = plan_tasks(rig, str(file))
        console = Console()
        if not console.is_terminal:
            console = Console(width=120)  # a file or pipe has no width of its own
        for part in plan_tables(rig, plan):
            console.print(part)
            console.print()


def templates(
    folder: Annotated[Path, typer.Argument(help="Where to put them; made if it is not there.")],
) -> None:
    """Copy the rig files and campaigns that come with the program, to be edited. Overwrites nothing."""
    with reported():
        for path in copy_shipped(folder):
            echo(path)

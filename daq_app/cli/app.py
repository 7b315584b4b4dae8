"""The root command `daq-app`. A command's module is loaded only when that command is used.

The modules load NumPy, SciPy, HDF5 and more: seconds, that nobody should wait for on `--help`.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Final

import typer
from typer.core import TyperCommand

from daq_app import ni_daqmx
from daq_app.cli.help_page import WIDTH, PlainGroup
from daq_app.extras import missing_extra
from daq_app.streams import use_utf8


@dataclass(frozen=True, slots=True)
class _Entry:
    modules: tuple[str, ...]
    """Modules of daq_app.cli with a ``register(app)`` function that make the command."""
    help: str
    """First sentence of its help, as the command itself has it (a test compares them)."""
    preloads: Mapping[tuple[str, ...], tuple[str, ...]] = field(default_factory=dict)
    """Words of a command line, its first one first → modules of daq_app that processes of the command begin
    to import before it is loaded itself."""


COMMANDS: Final[Mapping[str, _Entry]] = {
    "monitor": _Entry(
        ("monitor_commands",),
        "Open the operator's window: on a rig, or on an acquisition that runs already.",
    ),
    "view": _Entry(
        ("monitor_commands",),
        "Look at a run: time cursor, zoom, channels, export of pictures and data.",
    ),
    "config": _Entry(("config_commands",), "Check, show and copy rig files."),
    "demo": _Entry(
        ("demo_commands",),
        "Play a test day on a simulated wall: each test is zeroed, pulled, released, saved and reported.",
    ),
    "rig": _Entry(("rig_commands",), "Write rig files for walls of one's own."),
    "run": _Entry(
        ("record.commands",),
        "Take one release test: zero, arm, hold, release, rest, and the table of r.",
    ),
    "simulate": _Entry(
        ("record.commands",),
        "Write the run of a simulated test without real time, through the same sensors and modules.",
    ),
    "keys": _Entry(("record.commands",), "Keys of viewers elsewhere, and of other recorders to be trusted."),
    "campaign": _Entry(
        ("campaign.commands",),
        "Plan and follow a campaign of tests.",
        # The program itself too, which each process would import anew.
        preloads={
            ("report",): ("campaign.report.drawing", "campaign.report.report_tables", "cli.app"),
            ("report", "--anew"): ("rocking.analysis.analyse", "campaign.summaries.of_run"),
        },
    ),
    "publish": _Entry(
        ("campaign.publish",),
        "Make a folder that a repository takes: data, tables, figures, README, licence, metadata, checksums.",
    ),
    "analyse": _Entry(
        ("analyse.commands",),
        "Analyse a recorded test: θ0, impacts, peaks, speeds, periods, r by each method, base joint.",
    ),
    "theory": _Entry(
        ("theory_commands",),
        "p, α, r_max (both forms), periods T(φ), the decay T_n and φ_n, and the semi-rigid joint.",
    ),
    "verify": _Entry(
        ("runs.commands",),
        "Say of each run and journal that every sample is there or known to be missing, or what is wrong.",
    ),
    "recover": _Entry(
        ("runs.commands",),
        "Make a run of every journal that has none yet, or whose run is damaged. Safe to repeat.",
    ),
    "export": _Entry(
        ("runs.commands",),
        "Write a run, or a part of it, as CSV, MATLAB, TDMS, Parquet, netCDF or NumPy file.",
    ),
    "import": _Entry(("runs.import_command",), "Turn recordings of another program into runs."),
    "gap": _Entry(
        ("gap.commands", "gap.blind_commands"),
        "Where simulator and recordings differ, which effect explains it, how far it shrinks.",
    ),
}
"""In the order of the help page."""


_EXIT_HARDWARE: Final = 3
"""As `errors.EXIT_HARDWARE`, whose module loads what a first look at the command line does not need."""


class LazyCommands(PlainGroup):
    """Knows every command's name and first sentence; loads the command itself when it is called."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Names in the order of the help page."""
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command if it was loaded; otherwise its name and first sentence, enough for a help page."""
        entry = COMMANDS.get(cmd_name)
        if entry is None or cmd_name in self.commands:
            return self.commands.get(cmd_name)
        return TyperCommand(cmd_name, help=entry.help)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Load what the command line names, then do as any group does."""
        if args and args[0] in COMMANDS:
            if ni_daqmx.is_asked_for(args) and not {"--help", "-h"} & {*args} and not ni_daqmx.is_installed():
                print(f"Hardware: {ni_daqmx.NOT_INSTALLED}. {ni_daqmx.ADVICE}", file=sys.stderr)
                raise typer.Exit(_EXIT_HARDWARE)
            _preload(args)
            self.commands[args[0]] = load_command(args[0])
        return super().resolve_command(ctx, args)


def _preload(args: Sequence[str]) -> None:
    """Begin to import what processes of the command will need, on another core, unless help is asked for."""
    modules = [
        module
        for words, needed in COMMANDS[args[0]].preloads.items()
        if args[1:2] == [words[0]] and {*words} <= {*args}
        for module in needed
    ]
    if modules and not {"--help", "-h"} & {*args}:
        from daq_app.workers import warm_up

        warm_up(*(f"daq_app.{module}" for module in modules))


def load_command(name: str) -> Any:
    """The command of that name. `KeyError` if there is none."""
    app = typer.Typer(rich_markup_mode=None)
    for module in COMMANDS[name].modules:
        importlib.import_module(f"daq_app.cli.{module}").register(app)
    return typer.main.get_group(app).commands[name]


def build_app() -> typer.Typer:
    """The whole command tree."""
    app = typer.Typer(
        name="daq-app",
        cls=LazyCommands,
        rich_markup_mode=None,
        context_settings=WIDTH,
        pretty_exceptions_enable=False,
    )
    app.callback(invoke_without_command=True)(_root)
    return app


def _print_version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version  # slow to import, and rarely asked for

        typer.echo(f"daq-app {version('rocking-test-recorder')}")
        raise typer.Exit


def _root(
    context: typer.Context,
    show_version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and end."),
    ] = False,
) -> None:
    """Record, watch and analyse free-rocking tests of masonry walls. Without a command: the window."""
    if context.invoked_subcommand is None:
        importlib.import_module("daq_app.cli.monitor_commands").monitor()


def main() -> None:
    """Entry point of the console script."""
    use_utf8()
    # The matrices here are small: threads of the linear algebra spin more than they help, and take
    # processor time from the acquisition. Read by NumPy when it is loaded, by this process and its children.
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    try:
        build_app()()
    except ModuleNotFoundError as error:
        missing = missing_extra(error)
        if missing is None:
            raise
        print(f"Error: {missing}", file=sys.stderr)
        sys.exit(2)

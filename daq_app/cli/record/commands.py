"""`daq-app run`, `simulate` and `keys`: take a test, make one without real time, admit viewers."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from daq_app.cli.errors import EXIT_BAD_INPUT, EXIT_FAILED, print_paragraph, reported
from daq_app.cli.help_page import command_group
from daq_app.cli.record.seal_keys import register_seal_keys
from daq_app.cli.terminal import Console, echo, echo_json
from daq_app.streams import let_output_fail

if TYPE_CHECKING:
    from daq_app.cli.record.follow import RunEnd

LEVELS: Final = {"L1": 0.15, "L2": 0.25, "L3": 0.35, "L4": 0.40}
"""Release rotation over alpha of each level of the campaign (Table 3.2)."""
_LEVEL_IN_NAME: Final = re.compile(r"(?:^|-)(L[1-4])(?:-|$)")


def register(app: typer.Typer) -> None:
    """Add ``run``, ``simulate`` and ``keys``."""
    app.command("run", epilog="Example: daq-app run configs/fr1.toml --test FR1-L3-2 --headless --out runs")(
        run
    )
    app.command(
        "simulate", epilog="Example: daq-app simulate configs/fr1.toml --level L3 --r 0.9 --out run.h5"
    )(simulate)
    keys = command_group("Keys of viewers elsewhere, and of other recorders to be trusted.")
    keys.command("recorder", epilog="Example: daq-app keys recorder keys")(recorder_keys)
    keys.command("viewer", epilog="Example: daq-app keys viewer my-keys bench-laptop")(viewer_keys)
    register_seal_keys(keys)
    app.add_typer(keys, name="keys")


def level_of(test: str) -> str | None:
    """``L3`` of ``FR1-L3-2``; None where the name holds no level."""
    match = _LEVEL_IN_NAME.search(test)
    return match[1] if match else None


RigFile = Annotated[Path, typer.Argument(help="Rig file.", metavar="RIG.toml", show_default=False)]


def run(
    rig: RigFile,
    test: Annotated[str, typer.Option(help="Name of the test, for instance FR1-L3-2.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path("runs"),
    headless: Annotated[bool, typer.Option("--headless", help="No window; figures in the terminal.")] = False,
    connection: Annotated[
        str | None,
        typer.Option(help="local, grpc://HOST:PORT, simulated or replay:RUN.h5.", show_default="rig file"),
    ] = None,
    speed: Annotated[str, typer.Option(help="Time factor of a simulated device or replay.")] = "1",
    seed: Annotated[
        int | None, typer.Option(help="Seed of the simulated wall.", show_default="rig file")
    ] = None,
    notes: Annotated[str, typer.Option(help="Kept in the run.")] = "",
    release_within: Annotated[
        float, typer.Option(metavar="S", help="Longest wait for the release.")
    ] = 1800.0,
    spare: Annotated[
        Path | None, typer.Option(help="Folder on another disk, to go on in if the first fails.")
    ] = None,
    backup: Annotated[
        Path | None, typer.Option(help="Folder for TDMS files that the NI driver itself writes as well.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the results as JSON on stdout.")] = False,
) -> None:
    """Take one release test: zero, arm, hold, release, rest, and the table of r.

    The wall is zeroed upright and armed at once; pull it to its rotation and release it. Ctrl-C ends the
    test and keeps what was recorded. Exit code 0: complete; 1: the run is not a complete test;
    2: bad input; 3: hardware; 130: interrupted.
    """
    from daq_app.cli.record.follow import RunOptions, follow_run

    if headless:
        with reported():
            _require_rotation(rig)
    level = level_of(test)
    options = RunOptions(
        rig=rig,
        test=test,
        out=out,
        connection=connection,
        speed=speed,
        seed=seed,
        theta0_over_alpha=LEVELS[level] if level else None,
        notes=notes,
        release_within_s=release_within,
        spare=spare,
        backup=backup,
        window=not headless,
    )
    let_output_fail()
    console = Console(stderr=as_json)
    with reported():
        ended = follow_run(options, console)
    _tell_end(ended, console, as_json=as_json)
    raise typer.Exit(ended.exit_code)


def _tell_end(ended: RunEnd, console: Console, *, as_json: bool) -> None:
    """Results of the run if there is one, and what kept it from being a whole test."""
    from daq_app.cli.record.results import as_document, results_table

    if ended.run is not None:
        with reported():
            if as_json:
                echo_json(as_document(ended.run, ended.outcome), indent=1)
            else:
                console.print(results_table(ended.run))
    if ended.text:
        print_paragraph("Error" if ended.exit_code != EXIT_FAILED else "Incomplete", ended.text)


def _require_rotation(rig: Path) -> None:
    """Refuse a test that nobody watches and whose end nothing would notice."""
    from daq_app.config import load_rig

    if any(channel.family == "wire" for channel in load_rig(rig).channels):
        return
    print_paragraph(
        "Error",
        f"{rig} has no wire potentiometer, from which the rotation is computed: without a window nothing "
        "would end the test. Add one wire at least, or record with the window and stop by hand (F7)",
    )
    raise typer.Exit(EXIT_BAD_INPUT)


def simulate(
    rig: RigFile,
    out: Annotated[Path, typer.Option(help="Run file to write.", show_default=False)],
    level: Annotated[str, typer.Option(help="L1 to L4: release rotation 0.15 to 0.40 of alpha.")] = "L3",
    r: Annotated[
        float | None, typer.Option(help="Coefficient of restitution.", show_default="rig file")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed of noise and scatter.", show_default="rig file")
    ] = None,
    test: Annotated[
        str | None,
        typer.Option(help="Name of the test.", show_default="the file's name, else SPECIMEN-LEVEL-1"),
    ] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME:PARAMETER=VALUE",
            help="Effect beyond the rig file's, for instance viscous:zeta=0.006; may be repeated. "
            "`daq-app gap effects` lists them.",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the results as JSON on stdout.")] = False,
) -> None:
    """Write the run of a simulated test without real time, through the same sensors and modules."""
    from daq_app.cli.record.results import as_document, results_table
    from daq_app.cli.record.simulate import simulate_run

    if level not in LEVELS:
        print_paragraph("Error", f"{level} is no level. There are {', '.join(LEVELS)}")
        raise typer.Exit(EXIT_BAD_INPUT)
    with reported():
        simulate_run(
            rig,
            out,
            level=level,
            theta0_over_alpha=LEVELS[level],
            r=r,
            seed=seed,
            test=test,
            effects=effect or (),
        )
        if as_json:
            echo_json(as_document(out, "complete"), indent=1)
        else:
            Console().print(results_table(out))


KeyFolder = Annotated[Path, typer.Argument(help="Folder of the keys.", metavar="DIR", show_default=False)]


def recorder_keys(folder: KeyFolder) -> None:
    """Make the recorder's keys; give the folder to the acquisition with --keys.

    Put the public key (.key) of each viewer that may listen into the folder's `viewers`.
    """
    from daq_app.acquisition.viewers.curve import VIEWERS, create_recorder_keys

    with _writing(folder):
        public = create_recorder_keys(folder)
    echo(f"The recorder's public key, for viewers: {public}")
    echo(f"Viewers that may listen: put their .key files into {folder / VIEWERS}")


def viewer_keys(
    folder: KeyFolder,
    name: Annotated[str, typer.Argument(help="Name of the viewer.", metavar="NAME", show_default=False)],
) -> None:
    """Make a viewer's keys; the public one goes to the recorder, the secret one stays here."""
    from daq_app.acquisition.viewers.curve import create_viewer_keys

    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]{0,59}", name):
        print_paragraph("Error", f"'{name}' is no name: letters, digits, '-' and '_'")
        raise typer.Exit(EXIT_BAD_INPUT)
    with _writing(folder):
        public, secret = create_viewer_keys(folder, name)
    echo(f"For the recorder's folder of viewers: {public}")
    echo(f"Keep this one here (daq-app monitor --key): {secret}")


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    from daq_app.acquisition.viewers.curve import KeyFileError

    try:
        yield
    except KeyFileError as error:
        print_paragraph("Error", str(error))
        raise typer.Exit(EXIT_BAD_INPUT) from None
    except OSError as error:
        print_paragraph("Error", f"{folder} cannot be written to ({error.strerror})")
        raise typer.Exit(EXIT_BAD_INPUT) from None

"""`daq-app monitor` (also `daq-app` without arguments) and `daq-app view`: the operator's window."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Annotated, Any

import typer

from daq_app.cli.errors import EXIT_BAD_INPUT, EXIT_HARDWARE, print_paragraph, reported

_RigArgument = Annotated[
    Path | None, typer.Argument(help="Rig file; without it the window asks.", metavar="[RIG.toml]")
]
_Out = Annotated[Path | None, typer.Option(help="Folder of the runs.", show_default="the one used last")]
_Plan = Annotated[
    Path | None, typer.Option("--plan", help="Campaign file.", show_default="campaigns/ beside the rig file")
]
_Connect = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Attach to a running acquisition, tcp://HOST:PORT.")
]
_Token = Annotated[
    str, typer.Option(envvar="DAQ_APP_TOKEN", help="Right to command; without it the window only watches.")
]
_Speed = Annotated[str, typer.Option(help="Time factor of a simulated device or replay.")]
_Connection = Annotated[
    str | None,
    typer.Option(help="local, grpc://HOST:PORT, simulated or replay:RUN.h5.", show_default="rig file"),
]
_Key = Annotated[
    Path | None, typer.Option(metavar="FILE", help="This viewer's secret key (beyond loopback).")
]
_ServerKey = Annotated[Path | None, typer.Option(metavar="FILE", help="The recorder's public key.")]


def register(app: typer.Typer) -> None:
    """Add ``monitor`` and ``view``."""
    app.command("monitor", epilog="Example: daq-app monitor configs/fr1.toml --out runs")(monitor)
    app.command("view", epilog="Example: daq-app view runs/FR1-L3-2.h5")(view)


def monitor(
    rig: _RigArgument = None,
    out: _Out = None,
    plan: _Plan = None,
    connect: _Connect = None,
    token: _Token = "",
    connection: _Connection = None,
    speed: _Speed = "1",
    key: _Key = None,
    server_key: _ServerKey = None,
) -> None:
    """Open the operator's window: on a rig, or on an acquisition that runs already.

    Closing the window never ends a test: the acquisition is a process of its own.
    """
    window = _window()
    from daq_app.acquisition.viewers.client import AcquisitionUnreachable
    from daq_app.acquisition.viewers.curve import KeyFileError, ViewerKeys
    from daq_app.acquisition.viewers.launcher import AcquisitionDied

    if (key is None) != (server_key is None):
        print_paragraph(
            "Error", "--key and --server-key go together: this viewer's secret, the recorder's public key"
        )
        raise typer.Exit(EXIT_BAD_INPUT)
    try:
        with reported():
            if connect is not None:
                keys = ViewerKeys(key, server_key) if key is not None and server_key is not None else None
                code = window.run_on_address(connect, token, keys, plan)
            else:
                options = ["--speed", speed, *(["--connection", connection] if connection else [])]
                code = window.run_on_rig(rig, out, plan, options)
    except (AcquisitionUnreachable, KeyFileError) as error:
        print_paragraph("Error", str(error))
        raise typer.Exit(EXIT_BAD_INPUT) from None
    except AcquisitionDied as error:
        print_paragraph("Error", str(error))
        raise typer.Exit(error.exit_code if error.exit_code > 0 else EXIT_HARDWARE) from None
    raise typer.Exit(code)


def view(
    run: Annotated[Path, typer.Argument(help="Run file (.h5).", metavar="RUN", show_default=False)],
) -> None:
    """Look at a run: time cursor, zoom, channels, export of pictures and data."""
    if not run.is_file():
        print_paragraph("Error", f"there is no file {run}")
        raise typer.Exit(EXIT_BAD_INPUT)
    raise typer.Exit(_window().run_on_file(run))


def _window() -> Any:
    """The window's module; what is missing on this machine is said in words."""
    try:
        return importlib.import_module("daq_app.monitor.window.app")
    except ModuleNotFoundError:
        raise  # the root command says which extra brings it
    except ImportError as error:
        print_paragraph(
            "Error",
            f"the window cannot open here ({error}). On Debian and Ubuntu: apt-get install libegl1 libgl1 "
            "libxkbcommon0 libdbus-1-3 libfontconfig1. Tests can be taken without it: daq-app run --headless",
        )
        raise typer.Exit(EXIT_BAD_INPUT) from None

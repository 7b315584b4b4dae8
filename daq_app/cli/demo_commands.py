"""`daq-app demo`: a whole test day on a simulated wall, with nothing configured."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from daq_app.cli.errors import EXIT_BAD_INPUT, EXIT_FAILED, EXIT_HARDWARE, print_paragraph, reported
from daq_app.extras import absent
from daq_app.guarded import program

if TYPE_CHECKING:
    from daq_app.campaign.plan import PlannedTest
    from daq_app.config import Rig


def register(app: typer.Typer) -> None:
    """Add ``demo``."""
    app.command("demo", epilog="Example: daq-app demo --headless --tests 2")(demo)


def demo(
    folder: Annotated[Path, typer.Argument(help="Folder of the day; made if it is not there.")] = Path(
        "rocking-demo"
    ),
    tests: Annotated[int, typer.Option(min=1, max=36, help="How many tests of the campaign.")] = 4,
    headless: Annotated[bool, typer.Option("--headless", help="No window; ends by itself.")] = False,
    speed: Annotated[str, typer.Option(help="Time factor of the simulated wall, or max.")] = "1",
) -> None:
    """Play a test day on a simulated wall: each test is zeroed, pulled, released, saved and reported.

    Needs no rig, no hardware and no configuration. With the window, the tests play before your eyes; at
    the end it stays open on the last result.
    """
    from daq_app.campaign.plan import load_campaign
    from daq_app.cli.campaign.report import report
    from daq_app.config import load_rig
    from daq_app.config.shipped import shipped_configs

    console = Console(highlight=False, markup=False, soft_wrap=True)
    # Said before a day of tests is played, not after it.
    for extra in ("sim",) if headless else ("sim", "window"):
        if needed := absent(extra):
            print_paragraph("Error", needed)
            raise typer.Exit(EXIT_BAD_INPUT)
    no_report = absent("report")
    if no_report:
        console.print(f"No report will be made of the day: {no_report}")
    campaign_file = shipped_configs() / "campaigns" / "costa.toml"
    rig_file = shipped_configs() / "fr1.toml"
    runs = folder / "runs"
    with reported():
        runs.mkdir(parents=True, exist_ok=True)
        rig = load_rig(rig_file)
        of_rig = [t for t in load_campaign(campaign_file).tests if t.name.specimen == rig.specimen.name]
        planned = [test for test in of_rig if not any(runs.glob(f"{test.name}*.h5"))][:tests]
        if not planned:
            print_paragraph("Error", f"{runs} has every test of the day already. Name another folder")
            raise typer.Exit(EXIT_BAD_INPUT)
        options = ["--rig", str(rig_file), "--out", str(runs), "--speed", speed]
        last = _play(rig, planned, options, None if headless else campaign_file, console)
    if not no_report:
        report(runs, campaign_file, folder / "report", overwrite=True)  # that of the tests before these
    console.print(f"Look at the last run: daq-app view {last}")
    console.print("Your own wall: daq-app rig new")


def _play(
    rig: Rig, planned: Sequence[PlannedTest], options: list[str], shown: Path | None, console: Console
) -> str:
    """Take all tests, with a window on the campaign file `shown`; the file of the last run.

    Raises `typer.Exit` with what happened said.
    """
    from daq_app.acquisition.viewers.client import AcquisitionUnreachable
    from daq_app.acquisition.viewers.launcher import AcquisitionDied, AcquisitionProcess
    from daq_app.cli.record.test_day import DayEnded, TestDay

    console.print("Starting the acquisition and the simulated wall")
    try:
        process = AcquisitionProcess(options, say=console.print)
        with process.client() as client:
            window = _open_window(process.address, process.token, shown) if shown else None
            try:
                taken = TestDay(client, rig, console.print).take(planned)
                if window is not None:
                    console.print("The day is over; close the window when you have seen it")
                    window.wait()
            finally:
                client.request("shutdown", 60.0, force=1.0)
        console.print("Finishing the results of the tests")
        process.wait()
    except (AcquisitionDied, AcquisitionUnreachable) as error:
        print_paragraph("Error", str(error))
        raise typer.Exit(EXIT_HARDWARE) from None
    except DayEnded as error:
        print_paragraph("Incomplete", str(error))
        raise typer.Exit(EXIT_FAILED) from None
    return str(taken[-1].run)


def _open_window(address: str, token: str, campaign_file: Path) -> subprocess.Popen[bytes]:
    """The window, in a process of its own."""
    return subprocess.Popen(
        [
            *(program(), "-c", "from daq_app.cli import main; main()"),
            *("monitor", "--connect", address, "--plan", str(campaign_file)),
        ],
        stdin=subprocess.DEVNULL,
        env={**os.environ, "DAQ_APP_TOKEN": token},
    )

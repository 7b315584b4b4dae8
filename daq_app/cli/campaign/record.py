"""`daq-app campaign record`: the record of one test for signature."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from daq_app.cli.errors import reported
from daq_app.cli.terminal import Console, echo


def record(
    run_file: Annotated[Path, typer.Argument(help="Run file (.h5).", metavar="RUN")],
    out: Annotated[
        Path | None, typer.Option(help="File to write.", show_default="RUN.record.pdf beside the run")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a file that is there.")] = False,
) -> None:
    """Write the record of one test for signature: A4, one PDF.

    Rig, sensors and certificates, zero, check, plan, course of the test, notes, deviations, results, hashes
    and versions, with lines for names, dates and signatures. Every byte of the run is proven while it is
    made. A run that has no result yet is analysed.
    """
    from daq_app.campaign.record.write import write_record  # imported here: `--help` should not draw

    with reported():
        with Console(stderr=True).status("making the record …"):
            written = write_record(run_file, out, overwrite=overwrite)
        echo(f"{written}: written, {written.stat().st_size / 1e3:.0f} kB")

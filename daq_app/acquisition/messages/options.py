"""The command line of the acquisition process, for those who start it and for itself."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import platformdirs

READY: Final = "Acquisition listening on "
"""First words of the line on the process's standard output that says where; then the address."""


def _speed(text: str) -> str:
    if text == "max" or (_is_number(text) and 0 < float(text) < float("inf")):
        return text
    raise argparse.ArgumentTypeError("it is a factor above 0, or max")


def time_factor(speed: str) -> float:
    """How much faster than real time; infinite for `max`."""
    return float("inf") if speed == "max" else float(speed)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """Parse; exits with code 2 and a sentence for bad options."""
    parser = argparse.ArgumentParser(
        prog="python -m daq_app.acquisition",
        description="Samples, records and publishes; commanded over a socket. The token is taken from "
        "DAQ_APP_TOKEN, or made and written into OUT/.acquisition.json.",
        epilog="example: python -m daq_app.acquisition --rig configs/fr1.toml --out runs",
    )
    add = parser.add_argument
    add("--rig", type=Path, required=True, metavar="RIG.toml")
    add("--out", type=Path, required=True, metavar="DIR", help="folder of the runs")
    add("--connection", help="local, grpc://HOST:PORT, simulated or replay:RUN.h5; default: the rig file's")
    add(
        "--bind", default="tcp://127.0.0.1:0", help="where to listen for viewers (default: this machine only)"
    )
    add("--keys", type=Path, metavar="DIR", help="CURVE keys; needed to listen beyond this machine")
    add("--test", help="take this one test without an operator, then end")
    add("--notes", default="", help="kept in the run of --test")
    add("--release-within", type=float, default=1800.0, metavar="S", help="longest wait for a release")
    add(
        "--reconnect-within",
        type=float,
        default=30.0,
        metavar="S",
        help="how long to look for a device that does not answer before the run is closed",
    )
    add(
        "--spare",
        type=Path,
        metavar="DIR",
        default=platformdirs.user_data_path("rocking-test-recorder") / "spare",
        help="where to go on if the disk of OUT fails (best on another disk; default: %(default)s)",
    )
    add("--no-results", action="store_true", help="do not analyse each test when it has been saved")
    add("--backup", type=Path, metavar="DIR", help="let the NI driver write TDMS files there as well")
    add("--speed", type=_speed, default="1", help="time factor of a simulated device or a replay, or max")
    add("--seed", type=int, help="seed of the simulated wall's noise and scatter")
    add("--theta0-over-alpha", type=float, metavar="X", help="release rotation of the simulated wall")
    return parser.parse_args(argv)

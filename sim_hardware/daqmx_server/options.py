"""Command line of the simulated NI device server; loads nothing but the standard library."""

from __future__ import annotations

import argparse
from pathlib import Path


def _speed(text: str) -> float:
    if text == "max":
        return float("inf")
    value = float(text)
    if not 0 < value <= 10_000:
        raise argparse.ArgumentTypeError("speed is a factor above 0, or max")
    return value


def parser() -> argparse.ArgumentParser:
    """The command line."""
    options = argparse.ArgumentParser(
        prog="python -m sim_hardware.daqmx_server",
        description="Simulated NI-DAQmx device server (gRPC, loopback only): with a rocking wall wired to "
        "it, or on its own with the devices of an NI MAX export or of product names.",
        epilog="examples: python -m sim_hardware.daqmx_server --config configs/fr1.toml --speed 10; "
        "python -m sim_hardware.daqmx_server --device Dev1=PCIe-6363 --port 31763",
    )
    options.add_argument("--port", type=int, default=0, help="TCP port; 0 lets the system choose")
    _add_wall(options)
    _add_devices(options)
    options.add_argument("--faults", type=Path, metavar="FILE", help="script of faults (TOML or JSON)")
    options.add_argument(
        "--finite", choices=("real", "instant"), default="real", help="clock of finite tasks"
    )
    options.add_argument(
        "--missing",
        action="store_true",
        help="print which calls of the service are not simulated",
    )
    options.add_argument("--parent-pid", type=int, help="end when this process has ended")
    return options


def _add_wall(options: argparse.ArgumentParser) -> None:
    options.add_argument(
        "--config", type=Path, metavar="RIG.toml", help="rig: hardware and wall; none: no wall"
    )
    options.add_argument(
        "--speed", type=_speed, default=1.0, help="time factor, or max: time moves with the reads"
    )
    options.add_argument("--seed", type=int, help="seed of noise and scatter; default: the rig's")
    options.add_argument("--theta0-over-alpha", type=float, metavar="X", help="release rotation over alpha")
    options.add_argument(
        "--wall",
        choices=("scripted", "commanded", "marked"),
        default="scripted",
        help="pulled and released by the rig file's times, or by commands of the control service; "
        "marked: no wall, every sample of an LVDT tells its own place",
    )


def _add_devices(options: argparse.ArgumentParser) -> None:
    options.add_argument(
        "--max-export",
        type=Path,
        action="append",
        default=[],
        metavar="FILE.ini",
        help="take devices, scales, saved tasks and channels from NI MAX, not from the rig; may be repeated",
    )
    options.add_argument(
        "--device",
        action="append",
        default=[],
        metavar="NAME=PRODUCT",
        help="a device, for instance Dev1=PCIe-6363, cDAQ1=cDAQ-9178, cDAQ1Mod1=NI-9205; may be repeated",
    )
    options.add_argument(
        "--real",
        action="append",
        default=[],
        metavar="NAME",
        help="a device that calls itself not simulated: its inputs see its own outputs, not NI's sine",
    )
    options.add_argument(
        "--teds",
        action="append",
        default=[],
        metavar="TERMINAL=FILE",
        help="a sensor with a data sheet (virtual TEDS file) on a module that asks for it; may be repeated",
    )
    options.add_argument(
        "--products",
        type=Path,
        action="append",
        default=[],
        metavar="FILE.toml",
        help="product file of your own; may be repeated",
    )

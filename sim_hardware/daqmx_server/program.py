"""Command line, signals and life span of the simulated NI device server."""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import psutil

from daq_app.config.errors import ConfigError
from daq_app.config.hardware.catalogue import UnknownProduct
from daq_app.config.hardware.product_files import read_product_files
from daq_app.config.loader import load_rig
from daq_app.config.rig import Rig
from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.bench.clock import BenchClock, PacedClock, SteppedClock
from sim_hardware.daqmx_server.channels.teds import read_data_sheet
from sim_hardware.daqmx_server.errors import DaqmxError
from sim_hardware.daqmx_server.inventory.devices import Inventory, device_from_text
from sim_hardware.daqmx_server.inventory.max_export import MaxExport, load_max_export
from sim_hardware.daqmx_server.options import parser
from sim_hardware.daqmx_server.services.devices.storage import fill
from sim_hardware.daqmx_server.services.server import DaqmxServer, missing_table
from sim_hardware.faults.script import load_faults
from sim_hardware.first_start import start_compiling_motion
from sim_hardware.marked_line import MarkedLine
from sim_hardware.signals import NothingWired, SignalSource

_PARENT_POLL_S = 0.5


def build_bench(arguments: argparse.Namespace) -> Bench:
    """Inventory, wall, clock and faults from the command line.

    Raises `ConfigError`, `UnknownProduct`, or `ValueError` for a wall that makes no sense.
    """
    rig = None if arguments.config is None else load_rig(arguments.config)
    own = read_product_files(arguments.products)
    export = load_max_export(*arguments.max_export, own=own) if arguments.max_export else MaxExport()
    if rig is not None and not arguments.max_export:
        export.inventory = Inventory.from_rig(rig)
    for text in arguments.device:
        export.inventory.add(device_from_text(text, export.inventory, own))
    for name in arguments.real:
        device = export.inventory.devices.get(name)
        if device is None:
            raise ValueError(f"--real {name}: there is no such device")
        export.inventory.devices[name] = replace(device, simulated=False)
    if not export.inventory.devices:
        raise ValueError("no devices: give --config, --max-export or --device NAME=PRODUCT")
    clock: BenchClock = SteppedClock() if arguments.speed == float("inf") else PacedClock(arguments.speed)
    source = NothingWired() if rig is None else _wall(rig, arguments)
    bench = Bench(export.inventory, source, clock, arguments.finite)
    faults = load_faults(arguments.faults) if arguments.faults is not None else []
    with bench.changed:
        fill(bench, export)
        for text in arguments.teds:
            terminal, _, file = text.partition("=")
            bench.sensors[bench.inventory.named_channel(terminal, "AI")[1]] = read_data_sheet(file)
        for fault in faults:
            bench.add_fault(fault)
    return bench


def _report_unknown(inventory: Inventory) -> None:
    """Say which devices have no channels, since no product file describes them."""
    for device in inventory.without_channels():
        print(
            f"daqmx_server: {device.name} ({device.product_name}) has no channels: its product is in no "
            "product file. Write one and give it with --products",
            file=sys.stderr,
        )


def _wall(rig: Rig, arguments: argparse.Namespace) -> SignalSource:
    if arguments.wall == "marked":
        return MarkedLine(rig)
    from sim_hardware.virtual_rig import VirtualRig  # compiles its kernel: only once it is wanted

    wall: SignalSource = VirtualRig.from_rig(
        rig,
        seed=arguments.seed,
        theta0_over_alpha=arguments.theta0_over_alpha,
        scripted=arguments.wall == "scripted",
    )
    return wall


def warm_up(bench: Bench, arguments: argparse.Namespace, motion: subprocess.Popen[str] | None = None) -> None:
    """Load the wall's compiled kernels now: a second of it would be a second in which nothing is sampled.

    On a new machine they are compiled here. A commanded wall would meet those of the motion only at its
    release, so a scripted one is let go in its place. `motion`: the process that compiles them already.
    """
    terminals = tuple(name for device in bench.present() for name in device.physical_channels)
    if arguments.wall == "commanded":
        _compile_beside(bench, terminals, motion)
    bench.source.volts(terminals, np.linspace(0.0, 0.01, 11))
    if arguments.wall == "commanded":
        rehearsed = argparse.Namespace(**{**vars(arguments), "wall": "scripted"})
        _wall(load_rig(arguments.config), rehearsed).volts(terminals, np.arange(0.0, 60.0, 0.5))


def _compile_beside(bench: Bench, terminals: tuple[str, ...], motion: subprocess.Popen[str] | None) -> None:
    from sim_hardware import compiling  # compiles its kernels: only for a wall

    if motion is None:
        if compiling.motion_is_compiled():
            return
        motion = start_compiling_motion()
    print("Compiling the simulated wall, once on this machine: its motion and its sensors", flush=True)
    with compiling.without_collection():
        bench.source.volts(terminals, np.linspace(0.0, 0.01, 11))
    print("The sensors are compiled; the motion follows", flush=True)
    compiling.finish_compiling_motion(motion)


def main(argv: Sequence[str] | None = None, motion: subprocess.Popen[str] | None = None) -> int:
    """Serve until a signal, or until the parent has gone. Exit code 2 for a bad configuration.

    `motion`: a process that compiles the wall's motion already.
    """
    arguments = parser().parse_args(argv)
    if arguments.missing:
        print(missing_table())
        return 0
    try:
        server = DaqmxServer(build_bench(arguments), arguments.port)
    except (ConfigError, UnknownProduct, DaqmxError, ValueError, OSError, RuntimeError) as error:
        print(f"daqmx_server: {error}", file=sys.stderr)
        return 2
    _report_unknown(server.bench.inventory)
    if arguments.config is not None:
        warm_up(server.bench, arguments, motion)
    ended = threading.Event()
    for name in ("SIGINT", "SIGTERM", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda *_: ended.set())
    server.start()
    print(f"Server listening on port {server.port}", flush=True)
    while not ended.wait(_PARENT_POLL_S):
        if arguments.parent_pid is not None and not psutil.pid_exists(arguments.parent_pid):
            break
    server.stop(0.5)
    return 0

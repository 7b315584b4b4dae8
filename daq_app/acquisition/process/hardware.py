"""From the word for the connection to a way of making drivers."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from daq_app.acquisition.course.preflight import check_modules
from daq_app.acquisition.messages.options import time_factor
from daq_app.acquisition.process.simulated import SimulatedServer
from daq_app.config.rig import Rig
from daq_app.runfile import RunFileError, open_run
from drivers import Driver, DriverError, ReplayDriver, open_driver
from drivers.ni.local_library import require_ni_daqmx

_REPLAY = "replay:"


def driver_maker(
    connection: str, rig: Rig, options: argparse.Namespace, stack: ExitStack
) -> tuple[Callable[[], Driver], Callable[[], str]]:
    """How to make a driver for `connection`, and how to learn what the connection comes to.

    A simulated server is started here (both answers wait for it), a run that is replayed is opened;
    both end with `stack`. Raises `DriverError`.
    """

    def open_it(to: str) -> Driver:
        return open_driver(
            to,
            backup_folder=options.backup,
            ledger=options.out / ".open-tasks.json",
            object_to=lambda devices: check_modules(rig, devices),
            clock_speed=_finite(options.speed),
        )

    if connection == "simulated":
        server = stack.enter_context(SimulatedServer(options.rig, _server_options(options)))
        return (lambda: open_it(server.connection)), (lambda: server.connection)
    if connection.startswith(_REPLAY):
        return _replay(Path(connection.removeprefix(_REPLAY)), options, stack), (lambda: connection)
    if connection == "local":
        require_ni_daqmx()
    # Checks the address now rather than in the reader's thread.
    open_it(connection).close()
    return (lambda: open_it(connection)), (lambda: connection)


def planned_truth(connection: str, rig: Rig, options: argparse.Namespace) -> dict[str, Any] | None:
    """What a simulated run is made from, as far as it is known at arming; None for a real one."""
    if connection != "simulated":
        return None
    simulation = rig.simulation
    return {
        "simulated": True,
        "restitution": simulation.restitution,
        "restitution_scatter": simulation.restitution_scatter,
        "planned_theta0_over_alpha": options.theta0_over_alpha,
        "seed": simulation.seed if options.seed is None else options.seed,
        "semi_rigid": simulation.semi_rigid,
        "effects": simulation.effects,
    }


def _server_options(options: argparse.Namespace) -> list[str]:
    chosen = ["--speed", str(options.speed), "--wall", "commanded"]
    if options.seed is not None:
        chosen += ["--seed", str(options.seed)]
    if options.theta0_over_alpha is not None:
        chosen += ["--theta0-over-alpha", str(options.theta0_over_alpha)]
    return chosen


def _replay(path: Path, options: argparse.Namespace, stack: ExitStack) -> Callable[[], Driver]:
    try:
        run = stack.enter_context(open_run(path))
    except RunFileError as error:
        raise DriverError(error.message, advice=error.advice or "Choose a run file to replay") from error
    return lambda: ReplayDriver(run, time_factor(options.speed))


def _finite(speed: str) -> float:
    """A simulated device that runs as fast as it can has no rate; the driver learns what it sees."""
    factor = time_factor(speed)
    return factor if math.isfinite(factor) else 1.0

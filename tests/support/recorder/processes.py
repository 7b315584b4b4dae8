"""Acquisition processes for tests and long checks: started quickly; what a killed one leaves is cleared."""

from __future__ import annotations

import contextlib
import multiprocessing
import sys
from typing import TYPE_CHECKING

import grpc
import psutil
import session_pb2
import session_pb2_grpc

if TYPE_CHECKING:  # Windows has no fork server
    from multiprocessing.context import ForkServerContext, SpawnContext


def quick_context() -> ForkServerContext | SpawnContext:
    """Processes that start quickly where the platform can fork from one that has loaded everything."""
    if sys.platform == "win32":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(
        [
            "daq_app.acquisition.process.process",
            "daq_app.acquisition.session.session",
            "drivers.ni.nidaqmx_driver",
        ]
    )
    return context


def makers_of_runs(of: psutil.Process) -> list[psutil.Process]:
    """The living processes that make run files for `of`; an ended one that waits to be reaped is none."""
    found = []
    for child in of.children():
        with contextlib.suppress(psutil.Error):
            if "finalise_worker" in " ".join(child.cmdline()):
                found.append(child)
    return found


def free_the_hardware(connection: str) -> None:
    """Forget what killed sessions left on the device server, as its operator would with a reset."""
    with (
        contextlib.suppress(grpc.RpcError),  # the server may be what was killed
        grpc.insecure_channel(connection.removeprefix("grpc://")) as channel,
    ):
        session_pb2_grpc.SessionUtilitiesStub(channel).ResetServer(session_pb2.ResetServerRequest())

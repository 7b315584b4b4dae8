"""Runs one program of a stranger as it is: its hardware is a simulated server's, nothing else changes.

``python -m studies.ni_examples.stranger ADDRESS SECONDS PROGRAM``. After SECONDS somebody presses Enter where
the program asks for it, and Ctrl-C where it runs without end; plots are drawn to nowhere.
"""

from __future__ import annotations

import _thread
import builtins
import os
import runpy
import sys
import threading
from collections.abc import Callable
from typing import Any

import grpc
import nidaqmx
from nidaqmx import utils

from sim_hardware.control import SimControl, SimControlError

EDGES = ("/Dev1/PFI0", "/Dev1/PFI8")
"""Terminals at which somebody gives pulses while the program runs."""
_EDGE_PERIOD_S = 0.2
_PATIENCE = 4.0
"""Ctrl-C comes after so many times the wait before Enter, from the program's first task on."""


def _bring_hardware(address: str, on_first_task: Callable[[], None]) -> None:
    """Tasks, devices, scales and whatever else the program asks of its own machine come from the server."""
    channel = grpc.insecure_channel(address, options=[("grpc.max_receive_message_length", -1)])
    remote = nidaqmx.GrpcSessionOptions(channel, "")
    make, choose = nidaqmx.Task.__init__, utils._select_interpreter

    def make_task(self: Any, *given: Any, **named: Any) -> None:
        on_first_task()
        make(self, *given, **named)

    nidaqmx.Task.__init__ = make_task
    utils._select_interpreter = lambda options=None, interpreter=None: choose(options or remote, interpreter)


def _give_edges(address: str, over: threading.Event) -> None:
    with SimControl(address) as control:
        while not over.wait(_EDGE_PERIOD_S):
            for terminal in EDGES:
                try:
                    control.command("digital_edge", terminal=terminal, edge="rising")
                except SimControlError:
                    return


def main(address: str, seconds: float, program: str) -> None:
    os.environ["MPLBACKEND"] = "agg"
    over = threading.Event()
    enter = threading.Event()
    builtins.input = lambda *_: str(enter.wait(seconds) or "")
    threading.Thread(target=_give_edges, args=(address, over), daemon=True).start()
    ctrl_c = threading.Timer(_PATIENCE * seconds, _thread.interrupt_main)
    ctrl_c.daemon = True
    first = threading.Lock()

    def begin() -> None:
        if first.acquire(blocking=False):
            ctrl_c.start()

    _bring_hardware(address, begin)
    try:
        runpy.run_path(program, run_name="__main__")
    except KeyboardInterrupt:
        raise SystemExit("still waiting when Ctrl-C came, which it does not catch") from None
    finally:
        over.set()


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), sys.argv[3])

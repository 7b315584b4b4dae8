"""What is compiled at the first start on a machine: the wall's motion and its sensors.

Each takes about five seconds of processor time; Numba keeps the result on disk, and later starts load it.
``python -m sim_hardware.compiling`` compiles the motion (`first_start` starts it).
"""

from __future__ import annotations

import contextlib
import gc
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from daq_app.guarded import end_guarded
from sim_hardware.dynamics import Body, Release, Restitution, simulate_motion
from sim_hardware.dynamics.kernel import integrate
from sim_hardware.dynamics.pieces import constant_piece, evaluate
from sim_hardware.sensors import layout
from sim_hardware.sensors.state import march


@contextlib.contextmanager
def without_collection() -> Iterator[None]:
    """Cyclic collections wait: going through all that the compiler holds would take a seventh of its time."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def motion_is_compiled() -> bool:
    """Whether Numba has the motion on disk. True too where it compiles nothing (NUMBA_DISABLE_JIT)."""
    stats = getattr(integrate, "stats", None)
    return stats is None or any(Path(stats.cache_path).glob("kernel.integrate*.nbc"))


def finish_compiling_motion(process: subprocess.Popen[str]) -> None:
    """Compile here what is compiled quickly, then wait for the other process.

    Where that one fails, the motion is compiled at its first use.
    """
    with without_collection():
        evaluate(constant_piece(0.0, 0.0).reshape(1, -1), np.zeros(1), np.zeros(1), np.zeros(0), np.zeros(0))
        march(np.zeros((0, layout.N_EVENT)), np.zeros((1, layout.N_EPOCH)))
    process.wait()
    end_guarded(process)


def main() -> None:
    """Compile the motion."""
    with without_collection():
        simulate_motion(Body(0.2, 2.0, 1.4, 5000.0), Release(0.02), Restitution(0.9))


if __name__ == "__main__":
    main()

"""The first start on a machine: the wall's motion is compiled in a process of its own, beside all else.

Knows nothing of Numba, which takes a second to load.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Final

from daq_app.guarded import start_guarded

_KERNELS: Final = Path(__file__).parent / "dynamics"


def never_compiled() -> bool:
    """Whether the motion has surely not been compiled here: Numba would keep it beside its source.

    False where Numba keeps it elsewhere, or compiles nothing.
    """
    elsewhere = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("NUMBA_DISABLE_JIT")
    if elsewhere or not os.access(_KERNELS, os.W_OK):
        return False
    return not any((_KERNELS / "__pycache__").glob("kernel.integrate*.nbc"))


def start_compiling_motion() -> subprocess.Popen[str]:
    """Begin to compile the motion in another process, which ends with this one."""
    return start_guarded("sim_hardware.compiling", [], quiet=True)

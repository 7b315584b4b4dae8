"""A server that listens is ready for everything: nothing is compiled while a test is under way."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

_COMMANDED = """
import sys, numpy as np, numba
from sim_hardware.daqmx_server.options import parser
from sim_hardware.daqmx_server.program import build_bench, warm_up

def compiled():
    return {
        f"{name}.{key}": len(value.signatures)
        for name, module in list(sys.modules.items()) if name.startswith("sim_hardware")
        for key, value in vars(module).items() if isinstance(value, numba.core.dispatcher.Dispatcher)
    }

arguments = parser().parse_args(["--config", sys.argv[1], "--wall", "commanded"])
bench = build_bench(arguments)
warm_up(bench, arguments)
before, wall = compiled(), bench.source
wall.command("pull", {"duration_s": 0.2})
wall.advance(2.0)
assert wall.command("release", {})["state"] == "rocking"
wall.volts(("cDAQ1Mod1/ai0",), np.arange(2.0, 6.0, 0.01))
print({name for name, count in compiled().items() if before.get(name) != count} or "ready")
"""


def test_nothing_is_compiled_at_the_release(configs: Path) -> None:
    """On a new machine it would hold up the samples of the release for half a minute."""
    command = [sys.executable, "-c", _COMMANDED, str(configs / "fr1.toml")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "ready", done.stdout + done.stderr


_FIRST = """
import sys
from pathlib import Path
import sim_hardware.first_start as first_start

folder = Path(sys.argv[1])
first_start._KERNELS = folder
(folder / "__pycache__").mkdir()
new = first_start.never_compiled()
(folder / "__pycache__" / "kernel.integrate-1.py311.1.nbc").touch()
print(new, first_start.never_compiled(), [m for m in ("numba", "numpy") if m in sys.modules])
"""


def test_a_first_start_is_known_before_anything_is_loaded(tmp_path: Path) -> None:
    """The motion takes longest to compile: it is begun while the server still loads."""
    command = [sys.executable, "-c", _FIRST, str(tmp_path)]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert done.stdout.strip() == "True False []"

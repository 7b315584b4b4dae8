"""From the start of the window's process to its first live picture, on an acquisition that samples already.

``python -m benchmarks start``. Qt draws offscreen. The machine is warm: byte code is there, and the first
start does not count.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

from benchmarks.support.byte_code import byte_code_of
from benchmarks.support.effort import Effort
from benchmarks.support.figure import Figure
from daq_app.acquisition.messages.published import State, StateMessage
from daq_app.acquisition.viewers.launcher import AcquisitionProcess

RIG = Path(__file__).parents[1] / "configs" / "fr1.toml"
_STARTS = 5

_WINDOW = """
import os, sys, time
from pathlib import Path
from PySide6.QtCore import QTimer
from daq_app.monitor.data.settings import WindowSettings
from daq_app.monitor.window.app import application, campaign_beside, open_window
app = application()
address, token, folder, rig = sys.argv[1:5]
settings = WindowSettings(Path(folder) / "window.ini")
window = open_window(address, token, settings, plan=campaign_beside(Path(rig)))
window.show_page(window.live)
window.show()
def look():
    if window.session.sampling and window.live.motion.rotation.paints and window.live.strips.paints:
        used = time.process_time()
        print(used, flush=True)
        window.close()
        app.quit()
timer = QTimer()
timer.timeout.connect(look)
timer.start(5)
app.exec()
"""


def _start(address: str, token: str, folder: Path) -> tuple[float, float]:
    """Seconds from the start of the process to the picture, and processor seconds of the window."""
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    began_s = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-c", _WINDOW, address, token, str(folder), str(RIG)],
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    used = process.stdout.readline()
    ready_s = time.perf_counter() - began_s
    process.communicate(timeout=60.0)
    return ready_s, float(used)


def figures(effort: Effort) -> list[Figure]:
    """Median and longest start, and the processor time that one takes."""
    starts = effort.of(_STARTS, 1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        acquisition = AcquisitionProcess(["--rig", str(RIG), "--out", str(folder)])
        try:
            with acquisition.client() as client:
                while True:
                    received = client.receive(60.0)
                    if received is None:
                        raise RuntimeError("the acquisition process did not start to sample")
                    message = received.message
                    if isinstance(message, StateMessage) and message.state is State.PREVIEWING:
                        break
            with byte_code_of("daq_app.monitor.window.app"):
                _start(acquisition.address, acquisition.token, folder)
                measured = [_start(acquisition.address, acquisition.token, folder) for _ in range(starts)]
        finally:
            acquisition.kill()
    ready, used = zip(*measured, strict=True)
    note = (
        f"of an acquisition that samples; longest {max(ready):.2f} s; load {psutil.getloadavg()[0]:.1f} on "
    )
    note += f"{psutil.cpu_count()} cores"
    return [
        Figure(
            "start of the window to its live picture", statistics.median(ready), "s", starts, 2.0, note=note
        ),
        Figure("processor time of it", statistics.median(used), "s", starts),
    ]

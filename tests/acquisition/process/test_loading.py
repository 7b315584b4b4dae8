"""What the acquisition process loads before it has started a simulated server."""

from __future__ import annotations

import subprocess
import sys


def test_the_analysis_is_loaded_while_a_simulated_server_starts() -> None:
    """Both take seconds: one after the other a first test would wait for their sum."""
    slow = ("scipy", "daq_app.acquisition.session.session", "nidaqmx")
    code = (
        "import sys, daq_app.acquisition.process.process\n"
        f"print([name for name in {slow!r} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"

"""Has the result of each finished test made, in a process of its own with low priority, window or not."""

from __future__ import annotations

import contextlib
import queue
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Final

import psutil

from daq_app.guarded import end_guarded, start_guarded

_MODULE: Final = "daq_app.campaign.result.result"
"""Started by its name: the campaign knows this process, not the other way round."""
Told = Callable[[Path, bool, str], None]
"""(run, whether its result was made, what the maker said)"""


class ResultMaker(threading.Thread):
    """Makes results one after the other; `told` is called on this thread."""

    def __init__(self, told: Told) -> None:
        super().__init__(name="result-maker", daemon=True)
        self._told = told
        self._runs: queue.SimpleQueue[Path | None] = queue.SimpleQueue()
        self._waiting = 0
        self._process: subprocess.Popen[str] | None = None

    @property
    def busy(self) -> bool:
        """Whether a result is being made or waits to be."""
        return self._waiting > 0

    def make(self, run: Path) -> None:
        """Make the result of a run when the ones before are done."""
        self._waiting += 1
        self._runs.put(run)

    def run(self) -> None:
        """Until `close`."""
        while (run := self._runs.get()) is not None:
            ok, text = self._made(run)
            self._waiting -= 1
            self._told(run, ok, text)

    def close(self, grace_s: float) -> None:
        """Finish what was asked for if that takes no longer than `grace_s`; `recover` makes the rest."""
        self._runs.put(None)
        if not self.is_alive():
            return
        self.join(grace_s)
        if self.is_alive() and self._process is not None:
            end_guarded(self._process, grace_s=0.0)
            self.join(5.0)

    def _made(self, run: Path) -> tuple[bool, str]:
        try:
            self._process = process = start_guarded(_MODULE, [str(run)], quiet=True)
        except (OSError, MemoryError) as error:
            return False, (
                f"The result of {run.name} could not be made ({error or 'no memory'}). The run is safe. "
                "Close other programs, then open it on the Result page or run `daq-app recover` on its folder"
            )
        # Samples and pictures on the screen come first.
        with contextlib.suppress(psutil.Error, OSError, AttributeError):
            slow = psutil.BELOW_NORMAL_PRIORITY_CLASS if sys.platform == "win32" else 10
            psutil.Process(process.pid).nice(slow)
        assert process.stdout is not None
        text = process.stdout.read().strip()
        code = process.wait()
        end_guarded(process)
        return code == 0, text

"""The simulated device server as a child of the acquisition process: started on demand, ended with it."""

from __future__ import annotations

import contextlib
import re
import subprocess
import threading
from collections import deque
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Self

from daq_app.guarded import end_guarded, start_guarded
from daq_app.waiting import wait_for_start
from drivers import DriverError

_READY = re.compile(r"^Server listening on port (\d+)")


class SimulatedServer:
    """``sim_hardware.daqmx_server`` in its own process."""

    def __init__(self, rig_file: Path, options: Sequence[str] = ()) -> None:
        """Start the server; it needs some seconds, which the caller may use (see `connection`).

        Raises `DriverError` where the packages of the simulated hardware are not installed.
        """
        if find_spec("numba") is None:
            raise DriverError(
                "The simulated hardware is not installed",
                advice="python -m pip install 'rocking-test-recorder[sim]', or name another connection",
            )
        self._process = start_guarded(
            "sim_hardware.daqmx_server", ["--port", "0", "--config", str(rig_file), *options]
        )
        self._said: deque[str] = deque(maxlen=20)
        self._port = 0
        self._ready = threading.Event()
        threading.Thread(target=self._listen, name="simulated-server", daemon=True).start()

    @property
    def connection(self) -> str:
        """What to give to `drivers.open_driver`; waits until the server listens, as long as it works.

        Raises `DriverError` with what it said if it does not.
        """
        wait_for_start(self._ready, self._process.pid, lambda text: None)
        if not self._port:
            self.close()
            output = " ".join(self._said) or "it said nothing"
            raise DriverError(
                f"The simulated device server did not start ({output})",
                advice="Start it by hand to see why: python -m sim_hardware.daqmx_server --config RIG.toml",
            )
        return f"grpc://127.0.0.1:{self._port}"

    @property
    def process(self) -> subprocess.Popen[str]:
        return self._process

    def close(self) -> None:
        """End the server. Safe twice."""
        end_guarded(self._process)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _pass_on(self, line: str) -> None:
        """What the server says while it starts, for whoever started us."""
        with contextlib.suppress(OSError):  # who may be gone
            print(line.strip(), flush=True)

    def _listen(self) -> None:
        """Drain what the server says: a full pipe would stop it."""
        assert self._process.stdout is not None
        try:
            for line in self._process.stdout:
                self._said.append(line.strip())
                match = _READY.match(line)
                if match:
                    self._port = int(match[1])
                    self._ready.set()
                elif not self._port:
                    self._pass_on(line)
        except ValueError:  # closed while reading: we are ending it
            pass
        self._ready.set()

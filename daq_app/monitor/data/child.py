"""Work of another process, waited for off the window's thread."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from daq_app.guarded import end_guarded, start_guarded


def said_by(module: str, arguments: Sequence[str], limit_s: float = 300.0) -> tuple[bool, str]:
    """Whether a module that runs in a process of its own ended well, and what it said.

    It is killed after `limit_s`. Blocks: call it in the background.
    """
    process = start_guarded(module, arguments)
    late = threading.Timer(limit_s, process.kill)
    late.start()
    try:
        assert process.stdout is not None
        said = process.stdout.read()  # to its end; `communicate` would close its input, which ends it
        return process.wait() == 0, said.strip()
    finally:
        late.cancel()
        end_guarded(process)

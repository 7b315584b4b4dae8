"""``python -m daq_app.guarded MODULE ARGS…``: runs a module that ends with its parent.

The child's standard input is a pipe that only the parent holds: when the parent dies, even by kill −9,
the pipe closes and the child ends at once. Works on every platform; nothing is left behind.
"""

from __future__ import annotations

import contextlib
import os
import runpy
import subprocess
import sys
import threading
from collections.abc import Sequence


def start_guarded(
    module: str, arguments: Sequence[str], *, reads_input: bool = False, quiet: bool = False
) -> subprocess.Popen[str]:
    """Start ``python -m module arguments`` as a child that ends with this process.

    Its standard output is a pipe (text, line by line), its standard error is ours, or nobody's if it is
    `quiet`. It does not get the terminal's Ctrl-C: who started it ends it. A module that `reads_input`
    minds the end of its standard input itself.
    """
    guard = [] if reads_input else ["daq_app.guarded"]
    apart = (
        {"creationflags": getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)}
        if sys.platform == "win32"
        else {"start_new_session": True}
    )
    return subprocess.Popen(
        [sys.executable, "-u", "-m", *guard, module, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL if quiet else None,
        text=True,
        encoding="utf-8",
        **apart,
    )


def end_guarded(process: subprocess.Popen[str], grace_s: float = 2.0) -> None:
    """Close the pipe, then terminate, then kill. Safe twice."""
    if process.stdin is not None and not process.stdin.closed:
        with contextlib.suppress(OSError):
            process.stdin.close()
    try:
        process.wait(grace_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    if process.stdout is not None:
        process.stdout.close()


def _end_with_parent() -> None:
    while os.read(0, 4096):
        pass
    os._exit(0)


def main() -> None:
    """Watch the parent, then become the module."""
    module, *arguments = sys.argv[1:]
    threading.Thread(target=_end_with_parent, daemon=True).start()
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()

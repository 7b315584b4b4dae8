"""``python -m daq_app.guarded MODULE ARGS…``: runs a module that ends with its parent.

The child's standard input is a pipe that only the parent holds: when the parent dies, even by kill −9,
the pipe closes and the child ends at once. Works on every platform; nothing is left behind.

A thread that waits on the pipe holds a lock of its file on Windows, and a library that looks at standard
input while it is loaded waits for that lock for ever. So the child keeps the pipe to itself before it
waits: standard input is the null device from then on.
"""

from __future__ import annotations

import contextlib
import os
import runpy
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

from daq_app.streams import CHILD_ENVIRONMENT, use_utf8


def program() -> str:
    """The interpreter for child processes.

    A window that was started by pythonw.exe has children with standard streams: python.exe beside it.
    """
    own = Path(sys.executable)
    console = own.with_name("python.exe")
    return str(console) if own.name.lower() == "pythonw.exe" and console.is_file() else sys.executable


def apart() -> dict[str, Any]:
    """Options of `subprocess.Popen` for a child that no terminal ends, neither by Ctrl-C nor by closing.

    On Windows the child gets a console of its own that is never shown: without one (DETACHED_PROCESS)
    each of its own children would open a window.
    """
    if sys.platform == "win32":
        return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP | subprocess.CREATE_NO_WINDOW}
    return {"start_new_session": True}


def start_guarded(
    module: str, arguments: Sequence[str], *, reads_input: bool = False, quiet: bool = False
) -> subprocess.Popen[str]:
    """Start ``python -m module arguments`` as a child that ends with this process.

    Its standard output is a pipe (text, line by line), its standard error is ours, or nobody's if it is
    `quiet`. It does not get the terminal's Ctrl-C: who started it ends it. A module that `reads_input`
    minds the end of its standard input itself.
    """
    guard = [] if reads_input else ["daq_app.guarded"]
    return subprocess.Popen(
        [program(), "-u", "-m", *guard, module, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL if quiet else None,
        text=True,
        encoding="utf-8",
        errors="replace",
        env={**os.environ, **CHILD_ENVIRONMENT},
        **apart(),
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


def keep_input() -> TextIO:
    """Take the pipe from standard input, which becomes the null device. Returns the pipe as text, UTF-8."""
    pipe = os.dup(0)
    null = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null, 0)
    os.close(null)
    return os.fdopen(pipe, encoding="utf-8")


def _end_with_parent(pipe: TextIO) -> None:
    while pipe.read(4096):
        pass
    os._exit(0)


def main() -> None:
    """Watch the parent, then become the module."""
    module, *arguments = sys.argv[1:]
    use_utf8()
    threading.Thread(target=_end_with_parent, args=(keep_input(),), daemon=True).start()
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()

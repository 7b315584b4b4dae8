"""The program of the built folder: `daq-app`, and the interpreter that its child processes are started with.

Child processes are started as ``INTERPRETER -u -m MODULE ARGS…`` and ``INTERPRETER -c CODE ARGS…``; in the
built folder the interpreter is this program, which does the same with the modules that it holds.
"""

from __future__ import annotations

import multiprocessing
import os
import runpy
import sys


def main() -> None:
    """Be the module or the code that is asked for, or `daq-app`."""
    multiprocessing.freeze_support()
    arguments = sys.argv[1:]
    while arguments and arguments[0] == "-u":
        del arguments[0]
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.reconfigure(line_buffering=True, write_through=True)
    if arguments[:1] == ["-m"] and len(arguments) > 1:
        sys.argv = arguments[1:]
        runpy.run_module(arguments[1], run_name="__main__", alter_sys=True)
    elif arguments[:1] == ["-c"] and len(arguments) > 1:
        sys.argv = ["-c", *arguments[2:]]
        exec(compile(arguments[1], "<command>", "exec"), {"__name__": "__main__"})
    else:
        # Child processes replace what they cannot write; a built program does not read this by itself.
        encoding, _, errors = os.environ.get("PYTHONIOENCODING", "").partition(":")
        for stream in (sys.stdout, sys.stderr):
            if encoding and stream is not None:
                stream.reconfigure(encoding=encoding, errors=errors or None)
        from daq_app.cli import main as daq_app

        daq_app()


if __name__ == "__main__":
    main()

"""Standard streams that cannot stop a program: UTF-8 wherever they lead, and output that may fail."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Final, TextIO

CHILD_ENVIRONMENT: Final[Mapping[str, str]] = {"PYTHONIOENCODING": "utf-8:replace"}
"""For child processes: both ends of their pipes speak UTF-8, whatever the code page of the machine."""


def use_utf8() -> None:
    """Let standard output and error write θ and – on every machine.

    A pipe or file on Windows otherwise has the machine's code page (cp1252), in which they cannot be
    written. A program of the desktop (pythonw) has no streams at all; nothing is done there.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(encoding="utf-8", errors="replace")


class ForgivingStream:
    """A text stream that goes silent at its first failure, where what it accompanies must go on.

    A closed pipe, a full disk behind ``> file`` or a closed console end the output, not the recording.
    """

    encoding = "utf-8"

    def __init__(self, stream: TextIO | None) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write if that still works."""
        if self._stream is not None:
            try:
                self._stream.write(text)
            except (OSError, ValueError):
                self._go_silent()
        return len(text)

    def flush(self) -> None:
        """Flush if that still works."""
        if self._stream is not None:
            try:
                self._stream.flush()
            except (OSError, ValueError):
                self._go_silent()

    def isatty(self) -> bool:
        """Whether a person looks at it."""
        return self._stream is not None and self._stream.isatty()

    def fileno(self) -> int:
        """The descriptor. Raises `OSError` where there is none."""
        if self._stream is None:
            raise OSError("the stream is closed")
        return self._stream.fileno()

    def _go_silent(self) -> None:
        self._stream = None


def let_output_fail() -> None:
    """From here on no failure of standard output or error reaches the program.

    What cannot be written at the end of the process is given up in silence as well.
    """
    sys.stdout = ForgivingStream(sys.stdout)
    sys.stderr = ForgivingStream(sys.stderr)

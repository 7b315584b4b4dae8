"""What can go wrong with runs on disk, said so that the person at the rig can act."""

from __future__ import annotations

from typing import Any


class RunFileError(Exception):
    """A run, a journal or a foreign file that cannot be used, and what to do about it."""

    def __init__(self, message: str, *, advice: str = "") -> None:
        self.message = message
        self.advice = advice
        super().__init__(f"{message}. {advice}" if advice else message)

    def __reduce__(self) -> tuple[Any, ...]:
        """Errors of worker processes arrive whole: by default only `args` would be handed to `__init__`."""
        return _rebuilt, (type(self), self.args, self.__dict__)


def _rebuilt(kind: type[RunFileError], args: tuple[Any, ...], state: dict[str, Any]) -> RunFileError:
    error = kind.__new__(kind)
    error.args = args
    error.__dict__.update(state)
    return error


class BusyError(RunFileError):
    """Another process holds the folder or the journal."""


class JournalError(RunFileError):
    """Writing the journal failed. Samples before `safe_sample` are known to be on disk."""

    def __init__(self, message: str, *, advice: str, safe_sample: int) -> None:
        self.safe_sample = safe_sample
        super().__init__(f"{message}; safe on disk up to sample {safe_sample}", advice=advice)


class JournalDiskFull(JournalError):
    """No space left. The journal was cut back to its last whole frame: free space, then append again."""


class JournalDeviceError(JournalError):
    """The disk refused to write or to flush. This journal acknowledges nothing more."""


class JournalSlowDisk(JournalError):
    """A flush has not returned in the time allowed; it goes on in the background."""

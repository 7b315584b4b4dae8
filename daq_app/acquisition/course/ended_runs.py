"""Runs that are over: how many of them are not closed, and how many not saved."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class EndedRuns:
    """Counts the runs between their end and their run file. Each is closed first, and saved later."""

    _unclosed: int = 0
    """Courses that are over and whose journal is not closed yet."""
    _unsaved: int = 0
    """Closed journals whose run file is not made yet."""

    def end(self) -> None:
        """A course is over."""
        self._unclosed += 1

    def close(self) -> bool:
        """A journal is closed. Returns whether its course was over before: else the recorder gave it up."""
        self._unsaved += 1
        if not self._unclosed:
            return False
        self._unclosed -= 1
        return True

    def save(self) -> None:
        """What became of a run file is known. Where memory is short, this may be said twice of one."""
        self._unsaved = max(self._unsaved - 1, 0)

    @property
    def all_saved(self) -> bool:
        """Whether the run that was saved last is the one that ended last."""
        return not self._unclosed and not self._unsaved

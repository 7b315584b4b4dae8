"""What becomes of this computer while it records: it slept, its clock was set, its memory runs short."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

import psutil

_STILL_S: Final = 1.5
"""Between two looks, which come five times a second."""
_SET_S: Final = 0.5
LOW_MEMORY_BYTES: Final = 400 * 2**20


@dataclass(frozen=True, slots=True)
class MachineNews:
    """Something that has just happened to the machine."""

    name: str
    """asleep, wall_clock, memory or handles"""
    severity: Literal["info", "warning", "error"]
    text: str
    value: float


def available_memory() -> int:
    """Bytes that programs can still get without others being pushed out."""
    return int(psutil.virtual_memory().available)


class MachineWatch:
    """Call `look` five times a second."""

    def __init__(
        self,
        monotonic: Callable[[], float] = time.monotonic,
        wall: Callable[[], float] = time.time,
        memory: Callable[[], int] = available_memory,
    ) -> None:
        self._monotonic, self._wall, self._memory = monotonic, wall, memory
        self._last: tuple[float, float] | None = None
        self._short = self._refused = False

    def look(self) -> list[MachineNews]:
        """What has happened since the last look."""
        now, wall = self._monotonic(), self._wall()
        news: list[MachineNews] = []
        if self._last is not None:
            passed, stepped = now - self._last[0], (wall - self._last[1]) - (now - self._last[0])
            if passed > _STILL_S:
                news.append(
                    MachineNews(
                        "asleep",
                        "warning",
                        f"This program stood still for {passed:.1f} s (computer asleep or overloaded). The "
                        "device's buffer is being read; what it could not hold is told as a gap. Switch off "
                        "sleep and close other programs",
                        passed,
                    )
                )
            if abs(stepped) > _SET_S:
                word = "forward" if stepped > 0 else "back"
                news.append(
                    MachineNews(
                        "wall_clock",
                        "warning",
                        f"This computer's clock was set {word} by {abs(stepped):.1f} s. Times in a run count "
                        "samples and are right; only its date is doubtful: note the true time",
                        stepped,
                    )
                )
        self._last = (now, wall)
        return news + self._look_at_memory()

    def _look_at_memory(self) -> list[MachineNews]:
        try:
            free = self._memory()
        except OSError as error:
            return self._tell_refusal(error)
        if self._refused:
            self._refused = False
            return [MachineNews("handles", "info", "This computer opens files again", 0.0)]
        if free < LOW_MEMORY_BYTES and not self._short:
            self._short = True
            text = (
                f"Only {free / 2**20:.0f} MB of memory are left. Close other programs now; samples are safe"
            )
            return [MachineNews("memory", "error", text, float(free))]
        if self._short and free >= 1.5 * LOW_MEMORY_BYTES:
            self._short = False
            return [MachineNews("memory", "info", "There is memory enough again", float(free))]
        return []

    def _tell_refusal(self, error: OSError) -> list[MachineNews]:
        """The system opens no file for us, not even its own account of the memory: out of handles, mostly."""
        if self._refused:
            return []
        self._refused = True
        text = (
            f"This computer refuses to open files ({error.strerror or error}). Close other programs now; "
            "samples of the test that runs are safe"
        )
        return [MachineNews("handles", "error", text, float(error.errno or 0))]

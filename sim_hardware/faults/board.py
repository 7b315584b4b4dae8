"""The fault board: what is, was or will be broken on the simulated bench."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_hardware.faults.distortion import distort
from sim_hardware.faults.model import ClockChange, Fault

VoltsAt = Callable[[str, float], float]


@dataclass(slots=True)
class Entry:
    """A fault on the board; `start_s` is None while it waits for the first acquisition."""

    number: int
    fault: Fault
    start_s: float | None
    end_s: float
    left: int
    """Reads that it still spoils, where it spoils single ones."""
    held_v: float | None = None

    def active(self, now_s: float) -> bool:
        return self.start_s is not None and self.start_s <= now_s < self.end_s and self.left > 0


class FaultBoard:
    """Faults by kind and place; without any, everything works. Called with the bench's lock held."""

    def __init__(self, now: Callable[[], float], volts_at: VoltsAt) -> None:
        self._now = now
        self._volts_at = volts_at
        self._entries: dict[int, Entry] = {}
        self._origin: tuple[float, float] | None = None

    # --- management ---------------------------------------------------------------------------

    def add(self, fault: Fault) -> int:
        """Put a fault on the board; its number."""
        number = max(self._entries, default=0) + 1
        start = fault.at_s
        if fault.at_sample is not None:
            start = None if self._origin is None else self._origin[0] + fault.at_sample / self._origin[1]
        elif start is None:
            start = self._now()
        if start is not None:
            start = max(start, self._now())  # what has been sampled stays as it was
        left = int(fault.parameters.get("count", 1))
        entry = Entry(number, fault, start, math.inf, left)
        self._entries[number] = entry
        self._settle(entry)
        return number

    def clear(self, number: int | None = None) -> None:
        """Mend one fault from now on, or all of them. What it did to earlier samples stays.

        `ValueError` for a number that is not on the board.
        """
        if number is not None and number not in self._entries:
            raise ValueError(f"there is no fault {number}; there are: {sorted(self._entries) or 'none'}")
        for entry in self._entries.values() if number is None else [self._entries[number]]:
            entry.end_s = min(entry.end_s, self._now())
            if entry.start_s is None:
                entry.left = 0

    def acquisition_started(self, first_s: float, rate_hz: float) -> None:
        """The first acquisition settles when faults "at sample" begin."""
        if self._origin is None:
            self._origin = (first_s, rate_hz)
            for entry in self._entries.values():
                if entry.start_s is None and entry.fault.at_sample is not None:
                    entry.start_s = first_s + entry.fault.at_sample / rate_hz
                    self._settle(entry)

    @staticmethod
    def _settle(entry: Entry) -> None:
        if entry.start_s is not None:
            # A frozen server is frozen in real seconds, whatever the bench's clock does: its gate ends it.
            frozen = entry.fault.kind == "server_frozen"
            entry.end_s = math.inf if frozen else entry.start_s + entry.fault.for_s

    def listing(self) -> list[dict[str, object]]:
        """All faults, for the control service."""
        now = self._now()
        return [
            {
                "number": entry.number,
                "kind": entry.fault.kind,
                "target": entry.fault.target,
                "start_s": entry.start_s,
                "end_s": None if math.isinf(entry.end_s) else entry.end_s,
                "active": entry.active(now),
            }
            for entry in self._entries.values()
        ]

    # --- questions of the bench -----------------------------------------------------------------

    def active(self, kind: str, *targets: str) -> Entry | None:
        """The fault of that kind at one of the places, if it is active now."""
        now = self._now()
        return next((entry for entry in self._of(kind, targets) if entry.active(now)), None)

    def take(self, kind: str, task: str) -> Fault | None:
        """A fault that spoils single reads: used up by one."""
        entry = self.active(kind, task, "")
        if entry is None:
            return None
        entry.left -= 1
        return entry.fault

    def clock_changes(self, places: Sequence[str]) -> tuple[ClockChange, ...]:
        """How the sample clocks of these chassis or devices run wrong."""
        changes = []
        for entry in self._of("stalled", places) + self._of("clock_drift", places):
            if entry.start_s is not None and entry.end_s > entry.start_s:
                drift = entry.fault.kind == "clock_drift"
                factor = 1.0 + 1e-6 * entry.fault.number("ppm") if drift else 0.0
                changes.append(ClockChange(entry.start_s, entry.end_s, factor))
        return tuple(changes)

    def forced_rate_hz(self, places: Sequence[str]) -> float | None:
        """Rate that a clock is coerced to against all rules."""
        entry = self.active("clock_rate", *places)
        return entry.fault.number("rate_hz") if entry else None

    def outage(self, places: Sequence[str]) -> tuple[Entry, bool] | None:
        """A chassis that is off the network now, and whether it is so for longer than is tolerated."""
        entry = self.active("chassis_offline", *places)
        if entry is None or entry.start_s is None:
            return None
        return entry, self._now() >= entry.start_s + entry.fault.number("tolerance_s")

    def distort(
        self, terminals: Sequence[str], times_s: NDArray[np.float64], volts: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Volts (len(terminals), len(times_s)) as the converters see them."""
        entries = [e for e in self._entries.values() if e.fault.place == "terminal" and e.start_s is not None]
        if not entries or not len(times_s):
            return volts
        out = np.array(volts)
        for row, terminal in enumerate(terminals):
            for entry in entries:
                if entry.fault.target.lower() == terminal.lower():
                    self._apply(entry, terminal, times_s, out[row])
        return out

    def _apply(
        self, entry: Entry, terminal: str, times_s: NDArray[np.float64], volts: NDArray[np.float64]
    ) -> None:
        assert entry.start_s is not None
        during = (times_s >= entry.start_s) & (times_s < entry.end_s)
        if not during.any():
            return
        if entry.held_v is None:
            entry.held_v = self._volts_at(terminal, entry.start_s)
        volts[during] = distort(entry.fault, entry.start_s, entry.held_v, times_s[during], volts[during])

    def _of(self, kind: str, targets: Sequence[str]) -> list[Entry]:
        if not self._entries:
            return []
        wanted = {target.lower() for target in targets}
        return [
            entry
            for entry in self._entries.values()
            if entry.fault.kind == kind and (not targets or entry.fault.target.lower() in wanted)
        ]

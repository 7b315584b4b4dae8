"""Reading a test from a record: by which family, from which zero, and confirmed by whom."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from daq_app.rocking.analysis.preparation.signals import (
    Lead,
    Signals,
    TestTimes,
    find_phases,
    quiet_end,
    read_signals,
)
from daq_app.rocking.families import unfit_words
from daq_app.rocking.families.finding import FamilyFinding
from daq_app.rocking.record import TestRecord

_SAME_RELEASE_S: Final = 0.05
"""Two families show one release where they date it no further apart than this (assumed). Raising it takes two
events for one test."""


@dataclass(frozen=True, slots=True)
class Reader:
    """How a record is read."""

    from_rest: bool
    """Whether every sensor's zero is that of the rest after the test."""
    ask_tiltmeters: bool = True
    """Whether the tiltmeters must confirm a hold."""

    def read(self, record: TestRecord, lead: Lead) -> tuple[Signals, TestTimes]:
        """The signals of a record and the test in the rotation of the family that leads.

        Offsets of a run without a tare may be so large that no hold is recognised, so the end of the record
        serves as the first guess of the rest. The record is read as it is where no rest shows a test.
        """
        signals = read_signals(record, lead)
        if not self.from_rest:
            return signals, self._phases(signals)
        end = quiet_end(signals)
        times = self._phases(signals if end is None else signals.zeroed(end))
        if times.rest is None:
            times = self._phases(signals)
        if times.rest is None:
            return signals, times
        signals = signals.zeroed(times.rest)
        return signals, self._phases(signals)

    def _phases(self, signals: Signals) -> TestTimes:
        return find_phases(signals, ask_tiltmeters=self.ask_tiltmeters)


@dataclass(frozen=True)
class FoundElsewhere:
    """A test that not all families show: how it is read, and which family shows something else."""

    reader: Reader
    signals: Signals
    times: TestTimes
    blamed: FamilyFinding


def shows_test(times: TestTimes) -> bool:
    """Whether a release with impacts was found."""
    return times.release_s is not None and bool(times.impacts_s)


def found_by_others(record: TestRecord, reader: Reader) -> FoundElsewhere | None:
    """The test that two of the three families show where wires and tiltmeters together show none.

    That of LVDTs and tiltmeters, else that of wires and LVDTs; None where there is neither.
    """
    if not record.family("lvdt"):
        return None
    signals, times = reader.read(record, "lvdts")
    if signals.lead != "lvdts":
        return None
    if shows_test(times):
        return FoundElsewhere(reader, signals, times, unfit_words.shows_no_test("wires"))
    alone = replace(reader, ask_tiltmeters=False)
    signals, times = alone.read(record, "wires")
    others = alone.read(record, "lvdts")[1]
    if not shows_test(times) or not shows_test(others):
        return None
    assert times.release_s is not None and others.release_s is not None
    if abs(times.release_s - others.release_s) > _SAME_RELEASE_S:
        return None
    return FoundElsewhere(alone, signals, times, unfit_words.shows_no_test("tiltmeters"))

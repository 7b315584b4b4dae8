"""Readings that are there already become a run as if recorded: same zero, states, journal, file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from daq_app.acquisition.closing.derive import derive
from daq_app.acquisition.course.header import make_header
from daq_app.acquisition.course.sequence import Sequence
from daq_app.acquisition.course.tare import Tare, take_tare
from daq_app.acquisition.messages.items import End
from daq_app.config import Rig, TaskPlan
from daq_app.rocking import LiveAnalyser
from daq_app.runfile import JournalWriter, RunFileError, finalise, read_journal
from daq_app.runfile.folder import JOURNAL_SUFFIX
from drivers import Opened

_TARE_S: Final = 1.0
_FOR_EVER_S: Final = 1e6


@dataclass(frozen=True, slots=True)
class Readings:
    """A whole test, from the wall upright on."""

    values: NDArray[np.float64]
    """(n_channels, n) in rig order, unit of the readings."""
    driver: str
    """Where they come from; kept in the run."""
    truth: dict[str, Any] | None = None


def record_offline(rig: Rig, rig_text: str, plan: TaskPlan, readings: Readings, out: Path, test: str) -> Path:
    """Zero over the first second, arm, record to the end of the test, and write `out`.

    Raises `NotSteady` if the wall is not upright at first, `RunFileError` if `out` exists or cannot be
    written; nothing is left behind then.
    """
    if out.exists():
        raise RunFileError(f"{out} exists already", advice="Choose another name; a run is never overwritten.")
    journal = out.with_suffix(JOURNAL_SUFFIX)
    armed = round(_TARE_S * plan.rate_hz)
    tare = take_tare(rig, readings.values[:, :armed], 0)
    opened = Opened(
        plan.rate_hz, {channel.id: channel.input_range_v for channel in rig.channels}, 0, (), readings.driver
    )
    header = make_header(rig, rig_text, plan, opened, tare, test=test, truth=readings.truth)
    out.parent.mkdir(parents=True, exist_ok=True)
    writer = JournalWriter(journal, header)
    try:
        with writer:
            _record(rig, plan, readings.values, armed, tare, writer)
        with read_journal(journal) as contents:
            derived, _ = derive(contents)
        return finalise(journal, out, derived, keep_journal=False)
    except BaseException:
        # What it was made from is still there: half of it on disk would only be in the way.
        journal.unlink(missing_ok=True)
        raise


def _record(
    rig: Rig,
    plan: TaskPlan,
    values: NDArray[np.float64],
    armed: int,
    tare: Tare,
    writer: JournalWriter,
) -> None:
    """The course of the test, block by block, as the acquisition process takes it."""
    analyser = LiveAnalyser(rig, plan.rate_hz, tare.readings)
    sequence = Sequence(rig.acquisition, plan.rate_hz, armed, _FOR_EVER_S)
    writer.append_event("armed", armed, f"Armed for {writer.header.test}", {"severity": "info"})
    for start in range(armed, values.shape[1], plan.read_samples):
        block = values[:, start : start + plan.read_samples]
        writer.append_block(start, block)
        events = analyser.process(start, block).events
        for event in events:
            if event.kind == "impact":
                writer.append_event("impact", round(event.sample), event.text, {"sample": event.sample})
        for change in sequence.advance(events, start + block.shape[1]):
            if isinstance(change, End):
                writer.append_event("end", change.sample, change.text, {"outcome": change.outcome})
                return
            writer.append_event(change.state.value, change.sample, change.text, {"severity": "info"})
    writer.append_event("end", values.shape[1], "The readings end here", {"outcome": "stopped"})

"""A run made again with another heading: other words and events around the same readings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from daq_app.runfile import Event, JournalWriter, RunHeader, finalise, open_run

_BLOCK = 4000


def rewrite_run(run: Path, out: Path, header: RunHeader, events: Sequence[Event] = ()) -> Path:
    """Record the readings and results of `run` as `out` under `header`; `events` join those of the run."""
    journal = out.with_suffix(".journal")
    with open_run(run) as old:
        derived, first = old.derived, old.first_sample
        told = sorted([*old.events, *events], key=lambda event: event.sample)
        with JournalWriter(journal, header) as writer:
            for start in range(0, old.n_samples, _BLOCK):
                stop = min(start + _BLOCK, old.n_samples)
                writer.append_block(first + start, old.readings(start=start, stop=stop))
                while told and (told[0].sample < first + stop or stop == old.n_samples):
                    event = told.pop(0)
                    writer.append_event(event.kind, event.sample, event.text, event.data)
    return finalise(journal, out, derived, keep_journal=False)

"""What travels between the threads of the acquisition process, in sample order.

reader → recorder (journal first) → analyst.  Requests enter the same stream, so that every thread
sees arming, blocks, gaps and the end of a run in one order.
"""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from daq_app.acquisition.messages.published import EventMessage
from daq_app.runfile import RunHeader
from drivers import Block, DriverError, Opened

Outcome = Literal["complete", "stopped", "aborted", "timeout", "failed"]
"""How a run ended: at rest, by the operator, before its release, after its longest duration, by a fault."""


@dataclass(frozen=True, slots=True)
class Arrived:
    """A block that the reader has just received."""

    block: Block
    arrived_s: float
    """`time.perf_counter()` when the read returned: the latency to disk is counted from here."""


@dataclass(frozen=True, slots=True)
class Lost:
    """Samples that will never come."""

    first_sample: int
    n_samples: int
    reason: str


@dataclass(frozen=True, slots=True)
class Noted:
    """An event for the journal (when recording) and for the viewers."""

    event: EventMessage


@dataclass(frozen=True, slots=True)
class Begin:
    """Record from here on. The recorder answers with the journal's path, or with the error."""

    journal: Path
    header: RunHeader
    done: Future[Path] = field(default_factory=Future)
    before_samples: int = 0
    """So many samples from before the order belong to the run, as far as they are in memory."""
    kept: bool = False
    """A release that nobody armed: it is never refused for want of a disk."""


@dataclass(frozen=True, slots=True)
class End:
    """The run is over; close the journal and hand it on."""

    outcome: Outcome
    sample: int
    text: str


@dataclass(frozen=True, slots=True)
class Ask:
    """A viewer's request that the analyst must answer in step with the samples."""

    name: str
    arguments: dict[str, Any]
    done: Future[tuple[str, dict[str, Any]]] = field(default_factory=Future)
    """Text for the operator, and data. `RequestRefused` says why not."""


@dataclass(frozen=True, slots=True)
class Started:
    """The tasks run; samples follow, from index 0."""

    opened: Opened


@dataclass(frozen=True, slots=True)
class SourceEnded:
    """No more samples will come: stopped as asked (no error), or by a fault."""

    error: DriverError | None


@dataclass(frozen=True, slots=True)
class Closed:
    """The recorder has ended a run; its run file is being made, unless nothing of it is left."""

    journal: Path | None
    end: End


@dataclass(frozen=True, slots=True)
class Saved:
    """What became of the run file."""

    ok: bool
    text: str
    path: str


Item = Arrived | Lost | Noted | Begin | End | Ask | Started | SourceEnded | Closed | Saved


class RequestRefused(Exception):
    """A request that cannot be granted now: why, and what to do, in one or two sentences."""

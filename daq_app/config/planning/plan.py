"""The task plan: what the planner makes of a rig, and all that a driver needs to know."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from daq_app.config.rig import Channel


@dataclass(frozen=True, slots=True)
class PlannedChannel:
    """One channel of a task, in the task's scan order."""

    channel: Channel
    rig_index: int
    """Row of this channel in every block: its place in the rig file."""
    skew_s: float
    """Delay of this channel's sample after the sample clock (multiplexer); the driver does not correct it."""
    input_delay_s: float
    """Lag of the converter's digital filter (delta-sigma); known, not corrected by the driver."""

    @property
    def time_offset_s(self) -> float:
        """Instant that sample k shows is ``k / rate + time_offset_s``."""
        return self.skew_s - self.input_delay_s


@dataclass(frozen=True, slots=True)
class PlannedTask:
    """One NI task. The master clocks and starts the others; slaves are armed first."""

    name: str
    channels: tuple[PlannedChannel, ...]
    requested_rate_hz: float
    rate_hz: float
    """Rate that the hardware will coerce the request to."""
    role: Literal["master", "slave"]
    clock_source: str = ""
    """Terminal of the shared sample clock; empty for the task's own clock."""
    start_trigger_source: str = ""
    exported_clock: str = ""
    """Terminal at which the master shows its sample clock to other chassis; empty without cables."""
    exported_trigger: str = ""
    buffer_samples: int = 0
    """Samples per channel of the driver's circular buffer."""


@dataclass(frozen=True, slots=True)
class PlanNote:
    """Something the operator should know though it is no error (a coerced rate, a large skew)."""

    severity: Literal["info", "warning"]
    where: str
    text: str


@dataclass(frozen=True, slots=True)
class TaskPlan:
    """All tasks of a rig. Every task runs at the one rate: a block is a rectangle (channel × sample)."""

    tasks: tuple[PlannedTask, ...]
    rate_hz: float
    channel_ids: tuple[str, ...]
    """Rig order: the row order of every block."""
    read_samples: int
    """Samples per channel of one read."""
    notes: tuple[PlanNote, ...] = ()

    @property
    def n_channels(self) -> int:
        return len(self.channel_ids)

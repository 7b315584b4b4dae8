"""What the analyst asks of the session around it."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path

from daq_app.acquisition.course.tare import Tare
from daq_app.acquisition.messages.items import Item
from daq_app.runfile import TestPlan


@dataclass(frozen=True, slots=True)
class Surrounding:
    """What the analyst asks of the session; all of it answers at once."""

    post: Callable[[Item], None]
    """Into the stream, by way of the recorder."""
    hurry: Callable[[bool], None]
    """Ask for samples in small pieces, from the release to the rest."""
    arm: Callable[[TestPlan, Tare], Future[Path]]
    """Begin to record a test; raises `RequestRefused`."""
    keep: Callable[[int, Tare], None]
    """Record the release at that sample, which nobody armed, from some time before it."""
    opening: Callable[[], bool]
    """Whether the device is being opened and started."""
    silent: Callable[[], bool]
    """Whether samples should come in, and none has for a second."""
    disk_safe: Callable[[], bool]
    """Whether samples of the run reach a disk."""
    free_bytes: Callable[[], int]
    """Room on the disk of the runs."""

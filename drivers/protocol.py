"""The one seam to the hardware.

A driver opens a task plan, starts it, and hands out rectangles of readings in which no sample is
missing.  All calls are made from one thread (the reader's); `read` blocks, the others are short.
Nothing above this module knows which driver it talks to.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from daq_app.config.planning.plan import TaskPlan


@dataclass(frozen=True, slots=True)
class ClockReading:
    """How many samples the device had taken, at an instant between two of our monotonic clock."""

    before_s: float
    after_s: float
    samples: int
    """Per channel, counted like `Block.first_sample`."""

    @property
    def width_s(self) -> float:
        """Time between the two instants, within which the count was read."""
        return self.after_s - self.before_s

    def follows(self, earlier: ClockReading, rate_hz: float, off_s: float) -> bool:
        """Whether samples taken at a rate since an earlier reading fit the time since, to within `off_s`."""
        taken_s = (self.samples - earlier.samples) / rate_hz
        least, most = self.before_s - earlier.after_s, self.after_s - earlier.before_s
        return least - off_s <= taken_s <= most + off_s


@dataclass(frozen=True, slots=True)
class Block:
    """Consecutive samples of every channel."""

    first_sample: int
    """Index of the first column since the tasks were started: 0 is the first sample of all."""
    readings: NDArray[np.float64]
    """(n_channels, n_samples), C-contiguous, rows in rig order, unit `Channel.reading_unit`."""
    read_time_ns: int
    """`time.time_ns()` when the read returned. A stamp only: time is sample index / rate."""
    backlog_samples: int
    """Samples per channel left in the driver's buffer after this read."""
    overloaded: tuple[str, ...] = ()
    """Channels that the hardware reported as overloaded since the last block."""
    clock: ClockReading | None = None
    """Taken now and then, where the device can tell."""

    @property
    def n_samples(self) -> int:
        return int(self.readings.shape[1])


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """What a device said of itself when it was opened."""

    name: str
    product: str
    serial: str
    simulated: bool


@dataclass(frozen=True, slots=True)
class DataSheet:
    """What the electronic data sheet of a sensor (TEDS, IEEE 1451.4) says of it."""

    manufacturer: int
    """Number of the maker, as IEEE gives them."""
    model: int
    version: str
    serial: int


@dataclass(frozen=True, slots=True)
class Opened:
    """What the hardware made of the plan: values read back, never the ones asked for."""

    rate_hz: float
    ranges: dict[str, tuple[float, float]]
    """Channel id → input range the hardware chose, unit of the reading."""
    buffer_samples: int
    devices: tuple[DeviceInfo, ...]
    driver: str
    """Name and version of the driver, for the run file."""
    adc_timing: dict[str, str] = field(default_factory=dict)
    """Channel id → how its module's converter trades speed for resolution, where the module has modes."""
    data_sheets: dict[str, DataSheet] = field(default_factory=dict)
    """Channel id → data sheet of the sensor on it, where it has one."""


class DriverError(Exception):
    """A failure of the hardware, its driver or the way to it, with what the operator should do.

    `partial` holds samples that were read before the failure: they are good and must be kept.
    `retryable` says that the same call may succeed later with nothing else done (a time-out);
    `recoverable` that `Driver.recover` may make reading possible again without a new start.
    """

    def __init__(
        self,
        message: str,
        *,
        advice: str,
        code: int | None = None,
        device: str = "",
        partial: Block | None = None,
        retryable: bool = False,
        recoverable: bool = False,
    ) -> None:
        self.message = message
        self.advice = advice
        self.code = code
        self.device = device
        self.partial = partial
        self.retryable = retryable
        self.recoverable = recoverable
        where = f"{device}: " if device else ""
        number = f" (NI-DAQmx {code})" if code is not None else ""
        super().__init__(f"{where}{message}{number}. {advice}")


@runtime_checkable
class BackupRecorder(Protocol):
    """A driver that can let the hardware's own driver software record as well: the second recorder."""

    def start_backup(self, stem: str) -> tuple[str, ...]:
        """Begin files for the run called `stem`; answers their paths, none where it is switched off."""
        ...

    def stop_backup(self) -> None:
        """Pause until the next run."""
        ...


class Driver(Protocol):
    """Life cycle: open → start → read … → stop → close. `close` is safe at any time and twice."""

    def open(self, plan: TaskPlan) -> Opened:
        """Reserve the hardware and commit the tasks. Raises `DriverError`, leaving nothing reserved."""
        ...

    def start(self) -> None:
        """Start the clock: slaves armed first, the master last."""
        ...

    def read(self, timeout_s: float, n_samples: int | None = None) -> Block:
        """Wait for the next `n_samples` (`plan.read_samples` if None) of every channel and return them.

        Returns more where more are waiting; less than `plan.read_samples` may be asked for at any time.
        `first_sample` follows the last block, except after `recover`, where it may lie beyond samples that
        are lost. Raises `DriverError` (with `partial` where samples had been read); `retryable` after a
        time-out.
        """
        ...

    def recover(self) -> str:
        """Make reading possible again after an error that is `recoverable`.

        The next block begins at the oldest sample that was not read yet and still exists: a
        `first_sample` beyond the last block's end is the gap. Tasks that have ended are started again; the
        gap is then as long as the clocks say, and the answer is a sentence on how well that is known. Where
        the sample clock ran on, the answer says what had been overwritten by then; it is empty where nothing
        was lost. Raises `DriverError`; `recoverable`: try again later.
        """
        ...

    def stop(self) -> None:
        """Stop the clock; samples not yet read are lost, so drain with `read` before."""
        ...

    def close(self) -> None:
        """Give the hardware back."""
        ...

"""The samples of one NI task as an unbroken row: what was read, what waits, where reading stands."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from nidaqmx import Task
from nidaqmx import errors as ni_errors
from nidaqmx.constants import ReadRelativeTo
from nidaqmx.stream_readers import AnalogMultiChannelReader
from numpy.typing import NDArray

from daq_app.config.planning.plan import PlannedTask
from drivers.ni.tasks import NOT_WHILE_LOGGING, virtual_name
from drivers.protocol import DriverError

_NO_SEEKING: Final = (NOT_WHILE_LOGGING, -200557)
"""Codes of a driver that does not let a running task be read from another place: NI's help on the property
RelativeTo says "settable while task is running: device-specific"."""
_SURE_SAMPLES = 200
"""Counters that moved by more than this while they were asked for prove nothing."""


class _OneRow(np.ndarray[Any, np.dtype[np.float64]]):
    """An array whose `flat` is its memory as one row.

    The client copies a reply of gRPC into `flat`. NumPy's own goes through it value by value, which takes
    half of a client's time for a read; a row is copied as a whole.
    """

    @property
    def flat(self) -> NDArray[np.float64]:  # type: ignore[override]
        return self.view(np.ndarray).reshape(-1)


class TaskStream:
    """Reads one task. Samples wait here until every task of the plan has delivered them."""

    def __init__(self, planned: PlannedTask, task: Task) -> None:
        self.planned = planned
        self.rows = np.array([item.rig_index for item in planned.channels])
        self._ids = {virtual_name(item.channel): item.channel.id for item in planned.channels}
        self._pending: list[NDArray[np.float64]] = []
        self.n_pending = 0
        self.position = 0
        """Index of the next sample to ask the device for."""
        self._sought = False
        self._overload_supported = True
        self._position_is_absolute = True
        self.attach(task)

    def attach(self, task: Task) -> None:
        """Read from `task` from now on: the same task of the device over a new way."""
        self.task = task
        self._reader = AnalogMultiChannelReader(task.in_stream)
        # The check would cost one more round trip at every read.
        self._reader.verify_array_shape = False

    def fill(self, n_samples: int, timeout_s: float) -> None:
        """Read until `n_samples` samples per channel wait here.

        Raises the nidaqmx client's errors; what had arrived by then waits here, too.
        """
        missing = n_samples - self.n_pending
        if missing <= 0:
            return
        data = np.empty((len(self.rows), missing))
        # A reply fills the array from its beginning, so many values for each sample. NaN where the last value
        # of each number of samples belongs shows a reply cut short: it must never pass as a reading.
        data.reshape(-1)[len(self.rows) - 1 :: len(self.rows)] = np.nan
        try:
            got = self._reader.read_many_sample(data.view(_OneRow), missing, timeout_s)
        except ni_errors.DaqReadError as error:
            got = int(error.samps_per_chan_read)
            # Over gRPC some errors tell how much was read but bring none of it.
            if got > 0 and not _has_nan(self._packed(data, got)):
                self._keep(data, got)
            raise
        self._keep(data, int(got))
        if got < missing:
            raise ni_errors.DaqReadError("fewer samples than asked for", -200284, got)

    def _keep(self, data: NDArray[np.float64], got: int) -> None:
        if got <= 0:
            return
        if got > data.shape[1]:
            raise DriverError(
                f"The device claims {got} samples where {data.shape[1]} were asked for",
                advice="They are asked for again; if it happens often, restart the device server",
                recoverable=True,
            )
        packed = self._packed(data, got)
        if _has_nan(packed):
            raise DriverError(
                "A reply of the device was cut short",
                advice="It is asked for again; if it happens often, restart the device server",
                recoverable=True,
            )
        self._pending.append(packed)
        self.n_pending += got
        self.position += got
        if self._sought:
            self._read_onwards()

    def _packed(self, data: NDArray[np.float64], got: int) -> NDArray[np.float64]:
        """A short read is packed: the stride is what was read, not what was asked for."""
        got = max(0, min(got, data.shape[1]))
        return data.reshape(-1)[: len(self.rows) * got].reshape(len(self.rows), got)

    def take(self, n_samples: int) -> NDArray[np.float64]:
        """The oldest `n_samples` waiting samples, (channels of this task, n_samples)."""
        if self._pending and self._pending[0].shape[1] == n_samples:
            taken = self._pending.pop(0)
        else:
            joined = np.concatenate(self._pending, axis=1)
            taken = np.ascontiguousarray(joined[:, :n_samples])
            self._pending = [joined[:, n_samples:]] if joined.shape[1] > n_samples else []
        self.n_pending -= n_samples
        return taken

    def total_acquired(self) -> int:
        """Samples per channel that the device has taken since the start."""
        return int(self.task.in_stream.total_samp_per_chan_acquired)

    def device_position(self) -> int:
        """Where the device believes that reading stands."""
        at = int(self.task.in_stream.curr_read_pos)
        if at == self.position or not self._position_is_absolute:
            return self.position
        # Some device might count within its buffer; then the two other counters still agree with us.
        before = self.available()
        total = self.total_acquired()
        after = self.available()
        if after - before < _SURE_SAMPLES and total - after <= self.position <= total - before:
            self._position_is_absolute = False
            return self.position
        return at

    def available(self) -> int:
        """Samples per channel that wait in the device's buffer."""
        return int(self.task.in_stream.avail_samp_per_chan)

    def overloaded(self) -> tuple[str, ...]:
        """Ids of overloaded channels; empty where the module cannot tell."""
        if not self._overload_supported:
            return ()
        try:
            # NI asks for this order: only the first call takes the snapshot that the second reads.
            if not self.task.in_stream.overloaded_chans_exist:
                return ()
            names = self.task.in_stream.overloaded_chans
        except ni_errors.DaqError:
            self._overload_supported = False
            return ()
        return tuple(self._ids[name] for name in names if name in self._ids)

    def seek(self, position: int, timeout_s: float) -> int:
        """Read from that absolute sample on, or from a later one where the device cannot go back.

        What waits here is dropped. The sample that the next read begins with.
        """
        self._pending.clear()
        self.n_pending = 0
        try:
            self.task.in_stream.relative_to = ReadRelativeTo.FIRST_SAMPLE
            self.task.in_stream.offset = position
        except ni_errors.DaqError as error:
            if int(error.error_code) not in _NO_SEEKING:
                raise
            self._pass_over(position, timeout_s)
        else:
            self.position = position
            self._sought = True
        return self.position

    def _pass_over(self, position: int, timeout_s: float) -> None:
        """Go on where the device stands, and read what lies before `position` for nothing."""
        self.position = int(self.task.in_stream.curr_read_pos)
        missing = position - self.position
        if missing > 0:
            self._reader.read_many_sample(np.empty((len(self.rows), missing)), missing, timeout_s)
            self.position = position

    def begin(self) -> None:
        """The task is about to start: its samples count from 0."""
        self._pending.clear()
        self.n_pending = 0
        self.position = 0
        if self._sought:
            self._read_onwards()

    def _read_onwards(self) -> None:
        self.task.in_stream.relative_to = ReadRelativeTo.CURRENT_READ_POSITION
        self.task.in_stream.offset = 0
        self._sought = False


def _has_nan(readings: NDArray[np.float64]) -> bool:
    """Whether any is NaN: the smallest of them is then, and no second array is made to find it."""
    return bool(np.isnan(readings.min()))

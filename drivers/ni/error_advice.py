"""What went wrong in NI-DAQmx or on the way to it, and what the operator should do about it.

`translate` turns every exception of the nidaqmx client into a `DriverError`: one plain sentence,
one piece of advice, and whether to try again.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from nidaqmx import errors as ni_errors

from drivers.ni.local_library import not_installed
from drivers.protocol import Block, DriverError


@dataclass(frozen=True, slots=True)
class Advice:
    """Sentence for the operator about one error code."""

    what: str
    do: str
    retryable: bool = False
    """The same read may succeed later with nothing else done."""
    recoverable: bool = False
    """`Driver.recover` may make reading possible again."""


_LOST = Advice(
    "The device does not answer any more",
    "Check its power, its cable or network and the module's seat; it is looked for, and "
    "reading goes on by itself when it is back",
    recoverable=True,
)
_OVERWRITTEN = Advice(
    "The computer read too slowly and the device overwrote samples before they were read",
    "Nothing to do at once: reading goes on at the oldest sample still there and the gap is recorded. "
    "If it happens again, close other programs or raise acquisition.buffer_s",
    recoverable=True,
)
_TOO_FAST = Advice(
    "The device could not hand over its samples in time, and its own memory ran over",
    "The tasks are started again and the gap is recorded. If it happens again, use a direct USB or "
    "network port, lower rate_hz or spread the channels over two chassis",
    recoverable=True,
)
_OUT_OF_STEP = Advice(
    "The chassis or its modules lost the clock that they share",
    "The tasks are started again and the gap is recorded. If it happens again, check the network switch, "
    "its time synchronisation and the cables between the chassis",
    recoverable=True,
)
_NO_SUCH_CHANNEL = Advice(
    "A terminal of the rig file does not exist on that module, or the module cannot measure that quantity",
    "Compare physical_channel and measurement with the modules in the slots (`daq-app config show`)",
)

BY_CODE: Final[dict[int, Advice]] = {
    -200279: _OVERWRITTEN,
    -200222: Advice(
        "The acquisition stopped because its buffer was full of samples that nobody had read",
        "The tasks are started again and the gap is recorded; close other programs or raise "
        "acquisition.buffer_s",
        recoverable=True,
    ),
    -200284: Advice(
        "No new samples arrived in time",
        "The read is tried again. If it lasts, the sample clock has stopped: check the chassis and, "
        "for several tasks, the line that shares the clock",
        retryable=True,
    ),
    -200474: Advice("The device did not finish in time", "The read is tried again", retryable=True),
    -200220: Advice(
        "There is no device of that name",
        "Compare the names in the rig file with those in NI MAX, and check that the chassis is switched "
        "on and the module is in its slot",
    ),
    -50103: Advice(
        "The device is reserved by another program or another task",
        "Close the other program (NI MAX test panel, LabVIEW, another recorder) or end its task, then "
        "try again. If none runs, reset the device in NI MAX",
    ),
    -200022: Advice(
        "Another task uses a resource that this one needs",
        "Close the other program that uses this device, then try again",
    ),
    -200170: _NO_SUCH_CHANNEL,
    -200431: _NO_SUCH_CHANNEL,
    -200077: Advice(
        "The device does not accept a value that was asked of it",
        "Compare input_range_v, rate_hz and terminal_config in the rig file with what the module can do "
        "(`daq-app config check` lists it)",
    ),
    -200081: Advice(
        "The device cannot sample that fast",
        "Lower rate_hz or take fewer channels on the module",
    ),
    -200332: Advice("The device cannot sample that fast", "Lower rate_hz or take fewer channels on it"),
    -200489: Advice(
        "The same terminal is used twice in one task", "Give each channel its own physical_channel"
    ),
    -200088: Advice(
        "The device server does not know this task any more (it was restarted or reset)",
        "The tasks are started again and the gap is recorded; what had been read is saved",
        recoverable=True,
    ),
    -200019: _TOO_FAST,
    -200361: _TOO_FAST,
    -200714: _TOO_FAST,
    -200141: Advice(
        "A counter received more edges than it could count before they were read",
        "Lower the frequency at the counter's input, or read the counter more often",
    ),
    -201273: _OUT_OF_STEP,
    -201423: _OUT_OF_STEP,
    -209838: _OUT_OF_STEP,
    -50405: _LOST,
    -50401: _LOST,
    -200175: _LOST,
    -200324: _LOST,
    -201003: _LOST,
    -201250: _LOST,
    -201251: _LOST,
    -201252: _LOST,
    -201253: _LOST,
    -201390: _LOST,
    -201401: _LOST,
    -201420: Advice(
        "The chassis is reserved by another computer on the network",
        "Release it there (NI MAX, Unreserve), or take it over: daq-app rig reserve CHASSIS CONNECTION",
    ),
    -201388: Advice(
        "The chassis is not reserved by this computer",
        "Reserve it (daq-app rig reserve CHASSIS CONNECTION, or NI MAX, Reserve Chassis), then try again",
    ),
    -201271: Advice(
        "Another product sits where the rig file expects this device",
        "Put the right module into the slot, or correct product in the rig file",
    ),
    -209836: Advice(
        "These modules cannot share one sample clock",
        "Put them in one chassis, or in chassis that are synchronised over the network",
    ),
    -201426: Advice(
        "These modules cannot share one sample clock",
        "Put them in one chassis, or in chassis that are synchronised over the network",
    ),
}
"""NI-DAQmx code → advice. -88xxx, the codes of the connection to a device, are a range: see `advice_for`."""

_UNKNOWN = Advice(
    "NI-DAQmx reported an error",
    "Reading is tried again and a gap is recorded. Look the code up in NI MAX or on ni.com; what had been "
    "read is saved",
    recoverable=True,
)
_STOPPED: Final = frozenset({-200088, -200222, -200361, -200019, -200714, -201273, -201423, -209838})
"""Codes of a task that has stopped for good, though its device is there: it has to be started again."""

BY_GRPC_STATUS: Final[dict[str, Advice]] = {
    "UNAVAILABLE": Advice(
        "The device server cannot be reached",
        "Check that it runs, its address and port (hardware.connection), the network, the firewall and, "
        "with grpcs://, the certificates on both sides",
        recoverable=True,
    ),
    "DEADLINE_EXCEEDED": Advice(
        "The device server does not answer",
        "It is asked again; if it stays silent, restart it",
        recoverable=True,
    ),
    "UNIMPLEMENTED": Advice(
        "The device server is too old for this program", "Install NI gRPC Device Server 2.2 or newer"
    ),
    "RESOURCE_EXHAUSTED": Advice(
        "A reply of the device server was larger than allowed", "Lower acquisition.read_period_s"
    ),
    "UNAUTHENTICATED": Advice(
        "The device server refused this computer", "Check the TLS certificates on both sides"
    ),
    "PERMISSION_DENIED": Advice(
        "The device server refused this computer", "Check the TLS certificates and rights on the server"
    ),
    "NOT_FOUND": BY_CODE[-200088],
    "FAILED_PRECONDITION": Advice(
        "A task of that name is left on the device server by a program that did not end well",
        "Reset the device server (NI MAX or its own command), then start again",
    ),
    "ALREADY_EXISTS": Advice(
        "A task of that name is open already on the device server",
        "End the other acquisition, or reset the device server",
    ),
    "INTERNAL": Advice(
        "A reply of the device server could not be understood", "It is asked again", recoverable=True
    ),
    "CANCELLED": Advice("The call to the device server was cancelled", "Start again", recoverable=True),
    "DATA_LOSS": Advice(
        "A reply of the device server was damaged on the way", "It is asked again", recoverable=True
    ),
    "UNKNOWN": Advice("The device server failed while it answered", "It is asked again", recoverable=True),
}
"""gRPC status → advice, for failures of the way to the device rather than of the device."""

_DEVICE = re.compile(r"(?:Device(?: Specified)?|Device Name|Physical Channel(?: Name)?): *([\w/-]+)", re.I)


def advice_for(code: int) -> Advice:
    """Advice on an NI-DAQmx code, also for the ranges that mean a lost connection."""
    if code in BY_CODE:
        return BY_CODE[code]
    if -88999 <= code <= -88000:
        return _LOST
    return _UNKNOWN


_AWAY_STATUS: Final = (
    *("UNAVAILABLE", "DEADLINE_EXCEEDED", "CANCELLED"),
    *("RESOURCE_EXHAUSTED", "UNAUTHENTICATED", "PERMISSION_DENIED"),
)
"""These say nothing about the task that was asked for."""


_GARBLED_STATUS: Final = ("INTERNAL", "DATA_LOSS", "UNKNOWN")


def is_garbled(error: ni_errors.Error) -> bool:
    """Whether `error` may be a reply that was damaged on its way rather than an answer about the task."""
    return isinstance(error, ni_errors.RpcError) and getattr(error.rpc_code, "name", "") in _GARBLED_STATUS


def has_ended(error: ni_errors.Error) -> bool:
    """Whether `error`, met while looking at a running task, means that the task has ended for good."""
    if isinstance(error, ni_errors.RpcError):
        return getattr(error.rpc_code, "name", "") not in _AWAY_STATUS
    if isinstance(error, ni_errors.DaqError):
        return advice_for(int(error.error_code)) is _LOST or int(error.error_code) in _STOPPED
    return False


def translate(error: Exception, *, doing: str, partial: Block | None = None) -> DriverError:
    """The `DriverError` that says what `error` of the nidaqmx client means for the operator.

    `doing` says what was tried, in the form "reading"; `partial` holds samples that are good.
    """
    if isinstance(error, DriverError):
        return error
    if isinstance(error, ni_errors.DaqError):
        return _from_daqmx(error, doing, partial)
    if isinstance(error, ni_errors.RpcError):
        return _from_rpc(error, doing, partial)
    if isinstance(error, (ni_errors.DaqNotFoundError, ni_errors.DaqNotSupportedError)):
        return not_installed(partial)
    if isinstance(error, ni_errors.DaqFunctionNotSupportedError):
        return DriverError(
            f"The installed NI-DAQmx driver lacks a function that {doing} needs",
            advice="Install NI-DAQmx 24.5 or newer",
            partial=partial,
        )
    # Anything else came out of the client while it unpacked a reply (a truncated one, say):
    # nothing of the reply was used, and the position can be asked for again.
    return DriverError(
        f"The answer to {doing} could not be used ({type(error).__name__}: {_first_line(str(error))})",
        advice="It is asked again; if it happens often, restart the device server",
        partial=partial,
        recoverable=True,
    )


def _from_daqmx(error: ni_errors.DaqError, doing: str, partial: Block | None) -> DriverError:
    code = int(error.error_code)
    advice = advice_for(code)
    message = advice.what
    if advice is _UNKNOWN:
        message = f"{advice.what} while {doing}: {_first_line(str(error))}"
    return DriverError(
        message,
        advice=advice.do,
        code=code,
        device=_device_in(str(error)),
        partial=partial,
        retryable=advice.retryable,
        recoverable=advice.recoverable,
    )


def _from_rpc(error: ni_errors.RpcError, doing: str, partial: Block | None) -> DriverError:
    """In the words of the operator; status and text of the transport stay with the cause."""
    status = getattr(error.rpc_code, "name", str(error.rpc_code))
    said = f"The call to the device server failed ({_first_line(str(error.description))})"
    advice = BY_GRPC_STATUS.get(status, Advice(said, "Start again", recoverable=True))
    return DriverError(
        f"{advice.what} (while {doing})",
        advice=advice.do,
        partial=partial,
        retryable=advice.retryable,
        recoverable=advice.recoverable,
    )


def _device_in(text: str) -> str:
    match = _DEVICE.search(text)
    return match.group(1) if match else ""


def _first_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[0] if lines else "no description"

"""The way to NI-DAQmx: the library of this machine, or a device server over gRPC.

Everything that creates a `Task` or a `System` does so here, so that no call can reach the wrong
machine: `nidaqmx.System.local()` and `Task()` without options always use the local library.
"""

from __future__ import annotations

import ipaddress
import os
import re
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import grpc
import nidaqmx
import nidaqmx.system
from nidaqmx.grpc_session_options import GrpcSessionOptions, SessionInitializationBehavior

from drivers.ni.replies import READ_CALL, in_place
from drivers.protocol import DriverError

_CHANNEL_OPTIONS = [
    # gRPC refuses messages above 4 MB unless told otherwise, and what a refused reply held is lost:
    # three seconds of 41 channels at 4000 Hz are 3.9 MB.
    ("grpc.max_receive_message_length", -1),
    ("grpc.max_send_message_length", -1),
    # A server that comes back after 2 s should be found at once, not after a minute of back-off.
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.max_reconnect_backoff_ms", 1000),
    # Despite its name this is how long one attempt may take: names, TCP, TLS and the first HTTP/2 frames of a
    # far or busy server. Every recovery makes a first attempt; one that is cut off too soon never succeeds.
    ("grpc.min_reconnect_backoff_ms", 5000),
    # Two connections of one process must not share a socket: a fresh one is how we get rid of a dead one.
    ("grpc.use_local_subchannel_pool", 1),
]
_TLS_SERVICE = "ni-grpc-device"
"""What NI's TLS settings call the device server."""
_ADDRESS = re.compile(r"^grpc(?P<tls>s?)://(?P<host>\[[0-9A-Fa-f:.]+\]|[^:/\s]+):(?P<port>\d{1,5})/?$")
_SHORT_CALL_S = 10.0


class Target(NamedTuple):
    """Where the NI-DAQmx driver is: this machine (`host` empty) or a device server."""

    host: str
    port: int
    tls: bool

    def __str__(self) -> str:
        return f"grpc{'s' if self.tls else ''}://{self.host}:{self.port}" if self.host else "local"


def parse_target(connection: str) -> Target:
    """``local``, ``grpc://HOST:PORT`` or ``grpcs://HOST:PORT`` (TLS as configured with nitlsconfig)."""
    if connection == "local":
        return Target("", 0, False)
    match = _ADDRESS.match(connection)
    if match is None or not 0 < int(match["port"]) < 65536:
        raise DriverError(
            f"'{connection}' is no way to the hardware",
            advice="Use local, grpc://HOST:PORT or grpcs://HOST:PORT (with TLS)",
        )
    target = Target(match["host"], int(match["port"]), bool(match["tls"]))
    if not target.tls and not _is_loopback(target.host) and not os.environ.get("DAQ_APP_ALLOW_PLAIN_GRPC"):
        raise DriverError(
            f"{target} would cross the network without encryption",
            advice="Use grpcs://HOST:PORT (TLS, set up with nitlsconfig on both sides); on a closed "
            "network of the rig's own you may set the environment variable DAQ_APP_ALLOW_PLAIN_GRPC=1",
        )
    return target


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


@dataclass(slots=True)
class _Deadline:
    """How long a call may take."""

    seconds: float = _SHORT_CALL_S


class _LimitedChannel:
    """Gives every call a deadline: the nidaqmx client sets none, so a frozen server would hang us.

    Samples of a read are taken from the reply where they lie. gRPC's interceptors would give a deadline, too,
    but make each call from its method anew: a sixth of what a short call costs here.
    """

    def __init__(self, channel: Any, deadline: _Deadline) -> None:
        self._channel = channel
        self._deadline = deadline

    def unary_unary(self, method: str, **options: Any) -> Callable[..., Any]:
        """The call of one request and one reply, made in the time that is allowed when it is called."""
        if method == READ_CALL:
            options["response_deserializer"] = in_place(options["response_deserializer"])
        call, deadline = self._channel.unary_unary(method, **options), self._deadline

        def limited(request: Any, metadata: Any = None) -> Any:
            return call(request, timeout=deadline.seconds, metadata=metadata)

        return limited

    def __getattr__(self, name: str) -> Any:
        return getattr(self._channel, name)


def _tls_channel(target: Target) -> Any:
    """Encrypted by this machine's NI settings. Raises `DriverError` where they lack or are switched off."""
    from nitlsconfig import NitlsconfigError
    from nitlsconfig.cli import ClientConfig, ClientServerMode
    from nitlsconfig.grpc_channel import create_grpc_device_channel

    host = target.host.strip("[]")
    try:
        # NI's function makes a plain channel without a word where the settings say so.
        off = ClientConfig(_TLS_SERVICE, host).server_mode is ClientServerMode.Disabled
        channel = None if off else create_grpc_device_channel(host, target.port, options=_CHANNEL_OPTIONS)
    except NitlsconfigError as error:
        raise DriverError(
            f"TLS to {host}:{target.port} is not set up on this machine ({error})",
            advice="Set it up with nitlsconfig, as NI's gRPC Device Server describes",
        ) from error
    if channel is None:
        raise DriverError(
            f"TLS to {host}:{target.port} is switched off in this machine's NI settings",
            advice="Switch it on with nitlsconfig (client, ni-grpc-device, server_mode)",
        )
    return channel


class Connection:
    """One way to one NI-DAQmx driver. Not thread-safe: it belongs to the reader's thread."""

    def __init__(self, connection: str) -> None:
        self.target = parse_target(connection)
        # Names of tasks are unique in a device server: a second session must never attach by accident.
        self.prefix = f"daq_app_{uuid.uuid4().hex[:8]}"
        self._deadline = _Deadline()
        self._raw: Any = None
        self._channel: Any = None
        if self.is_remote:
            self._connect()

    @property
    def is_remote(self) -> bool:
        return bool(self.target.host)

    def _connect(self) -> None:
        address = f"{self.target.host}:{self.target.port}"
        if self.target.tls:
            self._raw = _tls_channel(self.target)
        else:
            self._raw = grpc.insecure_channel(address, options=_CHANNEL_OPTIONS)
        self._channel = _LimitedChannel(self._raw, self._deadline)

    def reconnect(self) -> None:
        """Drop the socket and make a new one; does nothing for the local library."""
        if self.is_remote:
            self._raw.close()
            self._connect()

    def full_name(self, name: str) -> str:
        """What a task of the plan is called on the device server."""
        return f"{self.prefix}_{name}"

    def new_task(self, name: str) -> nidaqmx.Task:
        """A new, empty task of that name (made unique)."""
        unique = self.full_name(name)
        return nidaqmx.Task(
            unique,
            grpc_options=self._options(unique, SessionInitializationBehavior.INITIALIZE_SERVER_SESSION),
        )

    def attach_task(self, name: str) -> nidaqmx.Task:
        """The task that `new_task` made, over a new socket. Only for a device server."""
        return self.attach_by_full_name(self.full_name(name))

    def attach_by_full_name(self, unique: str) -> nidaqmx.Task:
        """Any task on the device server, by the name it has there."""
        return nidaqmx.Task(
            unique,
            grpc_options=self._options(unique, SessionInitializationBehavior.ATTACH_TO_SERVER_SESSION),
        )

    def versions(self) -> str:
        """Driver, way to it and client, for the run file."""
        version = ".".join(map(str, self.system().driver_version))
        return f"NI-DAQmx {version} via {self.target}, nidaqmx {nidaqmx.__version__}"

    def system(self) -> nidaqmx.system.System:
        """Inventory of the machine that this connection reaches."""
        if self.is_remote:
            return nidaqmx.system.System.remote(
                self._options("", SessionInitializationBehavior.INITIALIZE_SERVER_SESSION)
            )
        return nidaqmx.system.System.local()

    def limit_calls_to(self, seconds: float | None = None) -> None:
        """Deadline of the calls that follow; None is the usual one for short calls."""
        self._deadline.seconds = _SHORT_CALL_S if seconds is None else seconds

    def close(self) -> None:
        """Drop the socket. Tasks must have been closed before."""
        if self._raw is not None:
            self._raw.close()

    def _options(self, name: str, behaviour: SessionInitializationBehavior) -> GrpcSessionOptions | None:
        if not self.is_remote:
            return None
        return GrpcSessionOptions(self._channel, name, initialization_behavior=behaviour)

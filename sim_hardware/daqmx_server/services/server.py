"""The gRPC server: NI's services over the simulated bench, and the control service beside them."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

import grpc
import session_pb2
import session_pb2_grpc
from nidaqmx import _grpc_interpreter
from nidaqmx._stubs import nidaqmx_pb2

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.limits import LIMITS
from sim_hardware.daqmx_server.services.attributes.channels import ChannelGroup
from sim_hardware.daqmx_server.services.attributes.devices import (
    CalibrationGroup,
    DeviceGroup,
    PhysicalChannelGroup,
    SystemGroup,
)
from sim_hardware.daqmx_server.services.attributes.groups import AttributeGroup, Handler, attribute_handlers
from sim_hardware.daqmx_server.services.attributes.signals import EXPORT, TRIGGER
from sim_hardware.daqmx_server.services.attributes.tasks import (
    READ,
    REAL_TIME,
    TIMING,
    WRITE,
    BufferGroup,
    TaskGroup,
)
from sim_hardware.daqmx_server.services.control_service import control_handler
from sim_hardware.daqmx_server.services.devices.bridge_calibration import bridge_handlers
from sim_hardware.daqmx_server.services.devices.scale_calls import ScaleGroup, scale_handlers
from sim_hardware.daqmx_server.services.devices.storage import SavedGroup, storage_handlers
from sim_hardware.daqmx_server.services.devices.system_calls import system_handlers
from sim_hardware.daqmx_server.services.devices.teds_calls import teds_handlers
from sim_hardware.daqmx_server.services.devices.watchdog_calls import WatchdogGroup, watchdog_handlers
from sim_hardware.daqmx_server.services.events import STREAMS
from sim_hardware.daqmx_server.services.gate import Gate
from sim_hardware.daqmx_server.services.reads.analog_reads import read_handlers
from sim_hardware.daqmx_server.services.reads.counter_reads import counter_read_handlers
from sim_hardware.daqmx_server.services.reads.digital_reads import digital_read_handlers
from sim_hardware.daqmx_server.services.sessions import SessionError, SessionExistsError, session_handlers
from sim_hardware.daqmx_server.services.timing_calls import timing_handlers
from sim_hardware.daqmx_server.services.write_calls import write_handlers

_THREADS: Final = 64
_MAX_MESSAGE: Final = 256 * 1024 * 1024
_SERVICE: Final = nidaqmx_pb2.DESCRIPTOR.services_by_name["NiDAQmx"]

_GROUPS: Final[dict[str, AttributeGroup]] = {
    "Chan": ChannelGroup(),
    "Read": READ,
    "Timing": TIMING,
    "Trig": TRIGGER,
    "ExportedSignal": EXPORT,
    "Buffer": BufferGroup(),
    "Task": TaskGroup(),
    "SystemInfo": SystemGroup(),
    "Device": DeviceGroup(),
    "Scale": ScaleGroup(),
    "Write": WRITE,
    "RealTime": REAL_TIME,
    "CalInfo": CalibrationGroup(),
    "Watchdog": WatchdogGroup(),
    "PersistedTask": SavedGroup("saved_tasks", "task_name", Code.TASK_NOT_IN_MAX),
    "PersistedChan": SavedGroup("saved_channels", "channel", Code.GLOBAL_CHANNEL_UNKNOWN),
    "PersistedScale": SavedGroup("saved_scales", "scale_name", Code.SCALE_UNKNOWN),
    "PhysicalChan": PhysicalChannelGroup(),
}


_PARTS: Final = (
    session_handlers,
    timing_handlers,
    scale_handlers,
    read_handlers,
    digital_read_handlers,
    counter_read_handlers,
    write_handlers,
    system_handlers,
    watchdog_handlers,
    storage_handlers,
    bridge_handlers,
    teds_handlers,
)
"""Calls that are no attributes, by what they are about."""


def _serialise(reply: Any) -> bytes:
    """Messages, or bytes that a handler has encoded itself."""
    return reply if isinstance(reply, bytes) else bytes(reply.SerializeToString())


def _fail(context: Any, error: Exception, task: str) -> None:
    """Tell the client as NI's server does: text in the status, numbers in the trailing metadata."""
    if isinstance(error, DaqmxError):
        metadata = [("ni-error", str(error.code))]
        if error.samples_read is not None:
            metadata.append(("ni-samps-per-chan-read", str(error.samples_read)))
        if error.samples_written is not None:
            metadata.append(("ni-samps-per-chan-written", str(error.samples_written)))
        context.set_trailing_metadata(tuple(metadata))
        context.abort(grpc.StatusCode.UNKNOWN, error.text(task))
    if isinstance(error, SessionExistsError):
        context.abort(grpc.StatusCode.ALREADY_EXISTS, str(error))
    context.abort(grpc.StatusCode.FAILED_PRECONDITION, str(error))


def _task_of(request: Any) -> str:
    return str(request.task.name) if "task" in request.DESCRIPTOR.fields_by_name else ""


def _unary(bench: Bench, gate: Gate, handler: Handler) -> Callable[[Any, Any], Any]:
    def call(request: Any, context: Any) -> Any:
        gate.pass_through()
        if not context.is_active():  # the client gave up while the server was frozen
            context.abort(grpc.StatusCode.CANCELLED, "the call was cancelled")
        try:
            with bench.changed:
                reply = handler(bench, request)
        except (DaqmxError, SessionError, SessionExistsError) as error:
            gate.pass_through()
            _fail(context, error, _task_of(request))
        gate.pass_through()
        return reply

    return call


def _stream(
    bench: Bench, gate: Gate, handler: Callable[[Bench, Any, Any], Iterator[Any]]
) -> Callable[[Any, Any], Any]:
    def call(request: Any, context: Any) -> Iterator[Any]:
        gate.pass_through()
        try:
            for event in handler(bench, request, context):
                gate.pass_through()
                yield event
        except DaqmxError as error:
            _fail(context, error, _task_of(request))

    return call


def missing_calls() -> list[str]:
    """Calls of NI's service without a handler."""
    known = {*attribute_handlers(_GROUPS), *STREAMS}
    for part in _PARTS:
        known |= set(part())
    return [method.name for method in _SERVICE.methods if method.name not in known]


def missing_table() -> str:
    """Markdown: what the server does not do, and what it does instead."""
    made = set(re.findall(r"self\._client\.(\w+)", inspect.getsource(_grpc_interpreter)))
    missing = missing_calls()
    calls = {
        "calls of the Python client": [call for call in missing if call in made],
        "calls that the Python client does not know": [call for call in missing if call not in made],
    }
    refused = "are answered with: the server does not support the operation"
    rows = [(f"{whose}: {', '.join(names)}", refused) for whose, names in calls.items() if names]
    lines = ["| what is not as on NI's hardware | the server |", "|---|---|"]
    return "\n".join([*lines, *(f"| {what} | {does} |" for what, does in [*rows, *LIMITS])])


def daqmx_handler(bench: Bench, gate: Gate) -> grpc.GenericRpcHandler:
    """NI's NiDAQmx service; calls without a handler answer UNIMPLEMENTED by themselves."""
    handlers = attribute_handlers(_GROUPS)
    for part in _PARTS:
        handlers |= part()
    methods: dict[str, grpc.RpcMethodHandler] = {}
    for method in _SERVICE.methods:
        request_type: Any = getattr(nidaqmx_pb2, method.input_type.name)
        if method.name in handlers:
            methods[method.name] = grpc.unary_unary_rpc_method_handler(
                _unary(bench, gate, handlers[method.name]), request_type.FromString, _serialise
            )
        elif method.name in STREAMS:
            methods[method.name] = grpc.unary_stream_rpc_method_handler(
                _stream(bench, gate, STREAMS[method.name]), request_type.FromString, _serialise
            )
    return grpc.method_handlers_generic_handler(_SERVICE.full_name, methods)


class SessionUtilities(session_pb2_grpc.SessionUtilitiesServicer):
    """NI's service of the device server itself."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._reservations: dict[str, str] = {}

    def EnumerateDevices(self, request: Any, context: Any) -> Any:
        with self._bench.changed:
            devices = [
                session_pb2.DeviceProperties(
                    name=device.name,
                    model=device.product_name,
                    vendor="National Instruments",
                    serial_number=f"{device.serial:08X}",
                    product_id=device.product_number,
                )
                for device in self._bench.present()
            ]
        return session_pb2.EnumerateDevicesResponse(devices=devices)

    def Reserve(self, request: Any, context: Any) -> Any:
        holder = self._reservations.setdefault(request.reservation_id, request.client_id)
        return session_pb2.ReserveResponse(is_reserved=holder == request.client_id)

    def IsReservedByClient(self, request: Any, context: Any) -> Any:
        held = self._reservations.get(request.reservation_id) == request.client_id
        return session_pb2.IsReservedByClientResponse(is_reserved=held)

    def Unreserve(self, request: Any, context: Any) -> Any:
        held = self._reservations.get(request.reservation_id) == request.client_id
        if held:
            del self._reservations[request.reservation_id]
        return session_pb2.UnreserveResponse(is_unreserved=held)

    def ResetServer(self, request: Any, context: Any) -> Any:
        with self._bench.changed:
            self._bench.reset()
        self._reservations.clear()
        return session_pb2.ResetServerResponse(is_server_reset=True)


class DaqmxServer:
    """A simulated NI device server on the loopback address."""

    def __init__(self, bench: Bench, port: int = 0, kill: Callable[[], None] | None = None) -> None:
        self.bench = bench
        self.gate = Gate(bench) if kill is None else Gate(bench, kill)
        self._server = grpc.server(
            ThreadPoolExecutor(_THREADS, thread_name_prefix="daqmx"),
            options=(
                ("grpc.max_send_message_length", _MAX_MESSAGE),
                ("grpc.max_receive_message_length", _MAX_MESSAGE),
                ("grpc.so_reuseport", 0),
            ),
        )
        self._server.add_generic_rpc_handlers((daqmx_handler(bench, self.gate), control_handler(bench)))
        session_pb2_grpc.add_SessionUtilitiesServicer_to_server(SessionUtilities(bench), self._server)
        self.port = self._server.add_insecure_port(f"127.0.0.1:{port}")

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self.port}"

    def start(self) -> None:
        self.gate.start()
        self._server.start()

    def stop(self, grace_s: float | None = None) -> None:
        """Abort every task, then end."""
        with self.bench.changed:
            self.bench.reset()
        self.gate.stop()
        self.bench.helper.shutdown(wait=False, cancel_futures=True)
        self._server.stop(grace_s).wait()

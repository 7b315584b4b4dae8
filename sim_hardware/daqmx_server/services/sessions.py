"""Calls of the task life cycle: creation, channels, start and stop, logging, events that end."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nidaqmx._stubs import nidaqmx_pb2 as pb
from session_pb2 import Session

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels.create import create_channels
from sim_hardware.daqmx_server.channels.kinds import KINDS
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.requests import fields_of
from sim_hardware.daqmx_server.services.attributes.groups import Handler
from sim_hardware.daqmx_server.tasks.task import Task, task_named

_NEW, _ATTACH = 1, 2


class SessionError(Exception):
    """A task could not be created or attached to as the client demanded."""


class SessionExistsError(Exception):
    """A new session was demanded under a name that is taken."""


def new_task(bench: Bench, name: str, behavior: int) -> tuple[str, bool]:
    """(name, whether it is new) of a task of that name: attached to if it exists and the client allows."""
    exists = name in bench.tasks
    if exists and behavior == _NEW:
        raise DaqmxError(Code.DUPLICATE_TASK, f"Task Name: {name}")
    if not exists:
        if behavior == _ATTACH:
            raise SessionError(f"There is no session named {name!r} to attach to.")
        if not name:
            number = 0
            while (name := f"_unnamedTask<{number:X}>") in bench.tasks:
                number += 1
        bench.tasks[name] = Task(bench, name)
    return name, not exists


def create_task(bench: Bench, request: Any) -> Any:
    name, is_new = new_task(bench, request.session_name, request.initialization_behavior)
    return pb.CreateTaskResponse(task=Session(name=name), new_session_initialized=is_new)


def clear_task(bench: Bench, request: Any) -> Any:
    task_named(bench, request.task.name).clear()
    del bench.tasks[request.task.name]
    return pb.ClearTaskResponse()


def start_task(bench: Bench, request: Any) -> Any:
    task_named(bench, request.task.name).start()
    return pb.StartTaskResponse()


def stop_task(bench: Bench, request: Any) -> Any:
    task_named(bench, request.task.name).stop()
    return pb.StopTaskResponse()


def task_control(bench: Bench, request: Any) -> Any:
    task_named(bench, request.task.name).control(fields_of(request)["action"])
    return pb.TaskControlResponse()


def is_task_done(bench: Bench, request: Any) -> Any:
    return pb.IsTaskDoneResponse(is_task_done=task_named(bench, request.task.name).is_done())


def wait_until_done(bench: Bench, request: Any) -> Any:
    task_named(bench, request.task.name).wait_until_done(request.time_to_wait)
    return pb.WaitUntilTaskDoneResponse()


def _create_handler(rpc: str) -> Handler:
    reply = getattr(pb, f"{rpc}Response")

    def create(bench: Bench, request: Any) -> Any:
        task = task_named(bench, request.task.name)
        existing = {channel.name for channel in task.channels}
        task.add_channels(
            create_channels(
                bench.inventory, bench.scales, rpc, fields_of(request), existing, bench.data_sheets
            )
        )
        return reply()

    return create


def _nth_handler(rpc: str) -> Handler:
    reply = getattr(pb, f"{rpc}Response")

    def nth(bench: Bench, request: Any) -> Any:
        task = task_named(bench, request.task.name)
        names = task.devices if rpc.endswith("Device") else [channel.name for channel in task.channels]
        if not 1 <= request.index <= len(names):
            raise DaqmxError(Code.INVALID_VALUE, f"Index: {request.index}")
        return reply(buffer=names[request.index - 1])

    return nth


def configure_logging(bench: Bench, request: Any) -> Any:
    """DAQmx's own TDMS recorder."""
    task = task_named(bench, request.task.name)
    task.configure()
    fields = fields_of(request)
    task.reading.update(
        LOGGING_FILE_PATH=fields["file_path"],
        LOGGING_MODE=fields["logging_mode"],
        LOGGING_TDMS_GROUP_NAME=fields["group_name"] or task.name,
        LOGGING_TDMS_OPERATION=fields["operation"],
    )
    return pb.ConfigureLoggingResponse()


def start_new_file(bench: Bench, request: Any) -> Any:
    task = task_named(bench, request.task.name)
    task.reading["LOGGING_FILE_PATH"] = request.file_path
    if task.log.enabled:
        task.log.open()
    return pb.StartNewFileResponse()


def unregister_handler(kind_of: Callable[[dict[str, Any]], str], rpc: str) -> Handler:
    """Ending an event stream from the client's side."""
    reply = getattr(pb, f"{rpc}Response")

    def unregister(bench: Bench, request: Any) -> Any:
        task_named(bench, request.task.name).events.discard(kind_of(fields_of(request)))
        bench.changed.notify_all()
        return reply()

    return unregister


def session_handlers() -> dict[str, Handler]:
    """RPC name → handler."""
    out: dict[str, Handler] = {
        "CreateTask": create_task,
        "ClearTask": clear_task,
        "StartTask": start_task,
        "StopTask": stop_task,
        "TaskControl": task_control,
        "IsTaskDone": is_task_done,
        "WaitUntilTaskDone": wait_until_done,
        "ConfigureLogging": configure_logging,
        "StartNewFile": start_new_file,
        "UnregisterEveryNSamplesEvent": unregister_handler(
            lambda fields: "every_n", "UnregisterEveryNSamplesEvent"
        ),
        "UnregisterDoneEvent": unregister_handler(lambda fields: "done", "UnregisterDoneEvent"),
        "UnregisterSignalEvent": unregister_handler(
            lambda fields: f"signal{fields['signal_id']}", "UnregisterSignalEvent"
        ),
    }
    for method in pb.DESCRIPTOR.services_by_name["NiDAQmx"].methods:
        if method.name in KINDS:
            out[method.name] = _create_handler(method.name)
        elif method.name.startswith("GetNthTask"):
            out[method.name] = _nth_handler(method.name)
    return out

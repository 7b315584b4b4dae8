"""Calls of the task life cycle, configuration calls, and the other calls that are no attributes or reads."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from nidaqmx._stubs import nidaqmx_pb2 as pb
from session_pb2 import Session

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels.virtual import create_channels
from sim_hardware.daqmx_server.errors import Code, DaqmxError, error_text
from sim_hardware.daqmx_server.requests import fields_of
from sim_hardware.daqmx_server.services.attributes import Handler, unsupported
from sim_hardware.daqmx_server.tasks.task import Task, task_named, tasks_of
from sim_hardware.daqmx_server.timing import triggers

_NEW, _ATTACH = 1, 2


class SessionError(Exception):
    """A task could not be created or attached to as the client demanded."""


def create_task(bench: Bench, request: Any) -> Any:
    """A task of that name: attached to if it exists, unless the client demands otherwise."""
    name = request.session_name
    exists = name in bench.tasks
    if exists and request.initialization_behavior == _NEW:
        raise DaqmxError(Code.DUPLICATE_TASK, f"Task Name: {name}")
    if not exists:
        if request.initialization_behavior == _ATTACH:
            raise SessionError(f"There is no session named {name!r} to attach to.")
        if not name:
            number = 0
            while (name := f"_unnamedTask<{number:X}>") in bench.tasks:
                number += 1
        bench.tasks[name] = Task(bench, name)
    return pb.CreateTaskResponse(task=Session(name=name), new_session_initialized=not exists)


def load_task(bench: Bench, request: Any) -> Any:
    """Only tasks of this session can be loaded: none are saved in NI MAX."""
    if request.session_name not in bench.tasks:
        raise DaqmxError(Code.TASK_NOT_IN_MAX, f"Task Name: {request.session_name}")
    return pb.LoadTaskResponse(task=Session(name=request.session_name), new_session_initialized=False)


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


def sample_clock(bench: Bench, request: Any) -> Any:
    """CfgSampClkTiming."""
    task = task_named(bench, request.task.name)
    task.configure()
    fields = fields_of(request)
    task.timing.settings.update(
        SAMP_TIMING_TYPE=10388,
        SAMP_CLK_SRC=fields["source"],
        SAMP_CLK_RATE=fields["rate"],
        SAMP_CLK_ACTIVE_EDGE=fields["active_edge"],
        SAMP_QUANT_SAMP_MODE=fields["sample_mode"],
        SAMP_QUANT_SAMP_PER_CHAN=fields["samps_per_chan"],
    )
    return pb.CfgSampClkTimingResponse()


def input_buffer(bench: Bench, request: Any) -> Any:
    task = task_named(bench, request.task.name)
    task.configure()
    task.input_buffer = request.num_samps_per_chan
    return pb.CfgInputBufferResponse()


_TRIGGER_FIELDS: Final = {
    "CfgDigEdge": (
        triggers.DIGITAL,
        {"trigger_source": "DIG_EDGE_{}_TRIG_SRC", "trigger_edge": "DIG_EDGE_{}_TRIG_EDGE"},
    ),
    "CfgAnlgEdge": (
        triggers.ANALOG,
        {
            "trigger_source": "ANLG_EDGE_{}_TRIG_SRC",
            "trigger_slope": "ANLG_EDGE_{}_TRIG_SLOPE",
            "trigger_level": "ANLG_EDGE_{}_TRIG_LVL",
        },
    ),
    "CfgAnlgWindow": (
        triggers.WINDOW,
        {
            "trigger_source": "ANLG_WIN_{}_TRIG_SRC",
            "trigger_when": "ANLG_WIN_{}_TRIG_WHEN",
            "window_top": "ANLG_WIN_{}_TRIG_TOP",
            "window_bottom": "ANLG_WIN_{}_TRIG_BTM",
        },
    ),
}


def _trigger_handler(rpc: str, which: str, kind: int, names: dict[str, str]) -> Handler:
    reply = getattr(pb, f"{rpc}Response")

    def configure(bench: Bench, request: Any) -> Any:
        task = task_named(bench, request.task.name)
        task.configure()
        fields = fields_of(request)
        task.trigger[f"{which}_TRIG_TYPE"] = kind
        for field, attribute in names.items():
            task.trigger[attribute.format(which)] = fields[field]
        if "pretrigger_samples" in fields:
            task.trigger["REF_TRIG_PRETRIG_SAMPLES"] = fields["pretrigger_samples"]
        return reply()

    return configure


def _disable_handler(which: str) -> Handler:
    reply = getattr(pb, f"Disable{which.capitalize()}TrigResponse")

    def disable(bench: Bench, request: Any) -> Any:
        task = task_named(bench, request.task.name)
        task.configure()
        task.trigger[f"{which}_TRIG_TYPE"] = triggers.NONE
        return reply()

    return disable


def _create_handler(rpc: str) -> Handler:
    reply = getattr(pb, f"{rpc}Response")

    def create(bench: Bench, request: Any) -> Any:
        task = task_named(bench, request.task.name)
        existing = {channel.name for channel in task.channels}
        task.add_channels(create_channels(bench.inventory, bench.scales, rpc, fields_of(request), existing))
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
    if not task.log.enabled:
        raise unsupported("Read_Logging_FilePath")
    task.log.new_file(request.file_path)
    return pb.StartNewFileResponse()


def unregister_handler(kind_of: Callable[[dict[str, Any]], str], rpc: str) -> Handler:
    """Ending an event stream from the client's side."""
    reply = getattr(pb, f"{rpc}Response")

    def unregister(bench: Bench, request: Any) -> Any:
        task_named(bench, request.task.name).events.discard(kind_of(fields_of(request)))
        bench.changed.notify_all()
        return reply()

    return unregister


def device_handler(rpc: str) -> Handler:
    """ResetDevice and SelfTestDevice: both need the device; a reset aborts its tasks."""
    reply = getattr(pb, f"{rpc}Response")

    def call(bench: Bench, request: Any) -> Any:
        device = bench.inventory.device(request.device_name)
        bench.check_access(device)
        if rpc == "ResetDevice":
            for task in tasks_of(bench):
                if device.name in (*task.devices, *task.hosts):
                    task.abort()
        return reply()

    return call


def error_string(bench: Bench, request: Any) -> Any:
    return pb.GetErrorStringResponse(error_string=error_text(request.error_code))


def session_handlers() -> dict[str, Handler]:
    """RPC name → handler."""
    out: dict[str, Handler] = {
        "CreateTask": create_task,
        "LoadTask": load_task,
        "ClearTask": clear_task,
        "StartTask": start_task,
        "StopTask": stop_task,
        "TaskControl": task_control,
        "IsTaskDone": is_task_done,
        "WaitUntilTaskDone": wait_until_done,
        "CfgSampClkTiming": sample_clock,
        "CfgInputBuffer": input_buffer,
        "GetErrorString": error_string,
        "ConfigureLogging": configure_logging,
        "StartNewFile": start_new_file,
        "UnregisterEveryNSamplesEvent": unregister_handler(
            lambda fields: "every_n", "UnregisterEveryNSamplesEvent"
        ),
        "UnregisterDoneEvent": unregister_handler(lambda fields: "done", "UnregisterDoneEvent"),
        "UnregisterSignalEvent": unregister_handler(
            lambda fields: f"signal{fields['signal_id']}", "UnregisterSignalEvent"
        ),
        "ResetDevice": device_handler("ResetDevice"),
        "SelfTestDevice": device_handler("SelfTestDevice"),
        "DisableStartTrig": _disable_handler("START"),
        "DisableRefTrig": _disable_handler("REF"),
    }
    for prefix, (kind, names) in _TRIGGER_FIELDS.items():
        for which in ("Start", "Ref"):
            rpc = f"{prefix}{which}Trig"
            out[rpc] = _trigger_handler(rpc, which.upper(), kind, names)
    for method in pb.DESCRIPTOR.services_by_name["NiDAQmx"].methods:
        if method.name.startswith("CreateAI") and "physical_channel" in method.input_type.fields_by_name:
            out[method.name] = _create_handler(method.name)
        elif method.name.startswith("GetNthTask"):
            out[method.name] = _nth_handler(method.name)
    return out

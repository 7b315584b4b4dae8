"""What is saved in NI MAX: scales, global channels and tasks, loaded, saved and deleted."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any, Final

from nidaqmx._stubs import nidaqmx_pb2 as pb
from session_pb2 import Session

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels import metadata
from sim_hardware.daqmx_server.channels.create import create_channels
from sim_hardware.daqmx_server.channels.kinds import KINDS
from sim_hardware.daqmx_server.channels.scale import CustomScale
from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.inventory.devices import channel_list
from sim_hardware.daqmx_server.inventory.max_export import MaxExport
from sim_hardware.daqmx_server.services.attributes.groups import Handler, unsupported
from sim_hardware.daqmx_server.services.sessions import SessionExistsError
from sim_hardware.daqmx_server.tasks.task import Task, task_named

_CHANNEL_CALLS: Final = {
    "Analog Input": ("AI", "AI.MeasType"),
    "Analog Output": ("AO", "AO.OutputType"),
}
_NEW: Final = 1
Saved = dict[str, str]


def fill(bench: Bench, export: MaxExport) -> None:
    """Take over the scales, channels and tasks of an export."""
    bench.saved_channels.update(export.channels)
    bench.saved_tasks.update(export.tasks)
    for name, keys in export.scales.items():
        bench.saved_scales[name] = keys
        values = _values("Scale", keys)
        values["TYPE"] = _value("Scale", "TYPE", keys.get("ScaleType", "Linear"))
        values.setdefault("DESCR", "")
        values.setdefault("SCALED_UNITS", "")
        bench.scales[name] = CustomScale(values)


def _plain(text: str) -> str:
    return re.sub(r"[^A-Z0-9]", "", text.upper())


def _values(group: str, keys: Saved) -> dict[str, Any]:
    """Keys of a section such as ``AI.Max = 10`` → NI's attributes with values of their types."""
    names = {_plain(name): name for name in metadata.attributes_of(group)}
    known = {names[_plain(key)]: text for key, text in keys.items() if _plain(key) in names and text}
    return {name: _value(group, name, text) for name, text in known.items()}


def _value(group: str, name: str, text: str) -> Any:
    kind = metadata.attributes_of(group)[name][1]
    if kind == "Bool":
        return text.lower() in ("true", "1", "yes")
    if kind == "Double":
        return float(text)
    if kind == "DoubleArray":
        return [float(part) for part in text.split(",")]
    if kind in ("UInt32", "UInt64"):
        return int(float(text))
    if kind == "Int32":
        return metadata.enum_value(group, name, text)
    return text


def saved_channel(bench: Bench, name: str, shown: str, is_global: bool) -> list[VirtualChannel]:
    """The channel that is saved under a name. −200882 if there is none."""
    keys = bench.saved_channels.get(name)
    if keys is None:
        raise DaqmxError(Code.GLOBAL_CHANNEL_UNKNOWN, f"Channel Name: {name}")
    io, measurement_key = _CHANNEL_CALLS[keys.get("ChanType", "Analog Input")]
    values = _values("Chan", keys)
    wanted = _plain(keys.get(measurement_key, "Voltage"))
    rpc = next(
        rpc
        for rpc, kind in KINDS.items()
        if kind.io == io and _plain(kind.measurement) == wanted and not kind.teds
    )
    kind = KINDS[rpc]
    fields = {field: values[attribute] for field, attribute in kind.attributes.items() if attribute in values}
    fields["physical_channel"] = keys["PhysicalChanName"]
    fields["name_to_assign_to_channel"] = shown
    channels = create_channels(bench.inventory, bench.scales, rpc, fields, set(), bench.data_sheets)
    return [replace(channel, is_global=is_global) for channel in channels]


def add_global_channels(bench: Bench, request: Any) -> Any:
    task = task_named(bench, request.task.name)
    for name in channel_list(request.channel_names):
        task.add_channels(saved_channel(bench, name, name, True))
    return pb.AddGlobalChansToTaskResponse()


def load_task(bench: Bench, request: Any) -> Any:
    """A task of this session, or one that is saved in NI MAX."""
    name = request.session_name
    exists = name in bench.tasks
    if exists and request.initialization_behavior == _NEW:
        raise SessionExistsError(f"There is a session named {name!r} already.")
    if not exists:
        _load(bench, name)
    return pb.LoadTaskResponse(task=Session(name=name), new_session_initialized=not exists)


def _load(bench: Bench, name: str) -> None:
    keys = bench.saved_tasks.get(name)
    if keys is None:
        raise DaqmxError(Code.TASK_NOT_IN_MAX, f"Task Name: {name}")
    task = Task(bench, name)
    for channel in channel_list(keys.get("Channels", "")):
        shown = channel.rpartition("/")[2]
        task.add_channels(saved_channel(bench, channel, shown, False))
    task.timing.settings.update(_values("Timing", keys))
    bench.tasks[name] = task


def save_task(bench: Bench, request: Any) -> Any:
    task = task_named(bench, request.task.name)
    name = request.save_as or task.name
    for channel in task.channels:
        bench.saved_channels[f"{name}/{channel.name}"] = _keys_of(channel, request.author)
    keys = {"Channels": ", ".join(f"{name}/{channel.name}" for channel in task.channels)}
    keys |= {key: str(value) for key, value in task.timing.settings.items()}
    bench.saved_tasks[name] = keys | _author(request.author)
    return pb.SaveTaskResponse()


def _author(author: str) -> Saved:
    return {"Author": author, "AllowInteractiveEditing": "True", "AllowInteractiveDeletion": "True"}


def _keys_of(channel: VirtualChannel, author: str) -> Saved:
    io = next(name for name, (io, _) in _CHANNEL_CALLS.items() if io == channel.io)
    keys = {"ChanType": io, _CHANNEL_CALLS[io][1]: channel.measurement, "PhysicalChanName": channel.physical}
    return keys | {name: str(value) for name, value in channel.attributes.items()} | _author(author)


def save_channel(bench: Bench, request: Any) -> Any:
    task = task_named(bench, request.task.name)
    channel = task.channels_named(request.channel_name)[0]
    bench.saved_channels[request.save_as or channel.name] = _keys_of(channel, request.author)
    return pb.SaveGlobalChanResponse()


def save_scale(bench: Bench, request: Any) -> Any:
    if request.scale_name not in bench.scales:
        raise DaqmxError(Code.SCALE_UNKNOWN, f"Custom Scale Name: {request.scale_name}")
    name = request.save_as or request.scale_name
    bench.scales[name] = bench.scales[request.scale_name]
    bench.saved_scales[name] = _author(request.author)
    return pb.SaveScaleResponse()


def _delete_handler(rpc: str, field: str, table: str, missing: Code) -> Handler:
    reply = getattr(pb, f"{rpc}Response")

    def delete(bench: Bench, request: Any) -> Any:
        saved: dict[str, Saved] = getattr(bench, table)
        if saved.pop(getattr(request, field), None) is None:
            raise DaqmxError(missing, f"Name: {getattr(request, field)}")
        return reply()

    return delete


class SavedGroup:
    """Attributes of what is saved: author, and whether it may be edited."""

    def __init__(self, table: str, field: str, missing: Code) -> None:
        self._table = table
        self._field = field
        self._missing = missing

    def get(self, bench: Bench, request: Any, name: str) -> Any:
        saved: dict[str, Saved] = getattr(bench, self._table)
        wanted = getattr(request, self._field)
        if wanted not in saved:
            raise DaqmxError(self._missing, f"Name: {wanted}")
        keys = {_plain(key): text for key, text in saved[wanted].items()}
        if name.startswith("ACTIVE"):
            return False
        text = keys.get(_plain(name), "")
        return text if name == "AUTHOR" else text.lower() == "true"

    def set(self, bench: Bench, request: Any, name: str, value: Any) -> None:
        raise unsupported(name)

    def reset(self, bench: Bench, request: Any, name: str) -> None:
        raise unsupported(name)


def storage_handlers() -> dict[str, Handler]:
    """RPC name → handler."""
    return {
        "AddGlobalChansToTask": add_global_channels,
        "LoadTask": load_task,
        "SaveTask": save_task,
        "SaveGlobalChan": save_channel,
        "SaveScale": save_scale,
        "DeleteSavedTask": _delete_handler(
            "DeleteSavedTask", "task_name", "saved_tasks", Code.TASK_NOT_IN_MAX
        ),
        "DeleteSavedGlobalChan": _delete_handler(
            "DeleteSavedGlobalChan", "channel_name", "saved_channels", Code.GLOBAL_CHANNEL_UNKNOWN
        ),
        "DeleteSavedScale": _delete_handler(
            "DeleteSavedScale", "scale_name", "saved_scales", Code.SCALE_UNKNOWN
        ),
    }

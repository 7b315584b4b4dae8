"""Watchdog tasks: a timer on a device that sets its outputs when nobody resets it in time."""

from __future__ import annotations

from typing import Any, Final

from nidaqmx import constants
from nidaqmx._stubs import nidaqmx_pb2 as pb
from session_pb2 import Session

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels import metadata
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.requests import fields_of
from sim_hardware.daqmx_server.services.attributes.groups import Handler, unsupported
from sim_hardware.daqmx_server.services.sessions import new_task
from sim_hardware.daqmx_server.tasks.task import State, Task, task_named

_RESET: Final = constants.WDTTaskAction.RESET_TIMER.value


def create_watchdog(bench: Bench, request: Any) -> Any:
    """CreateWatchdogTimerTaskEx."""
    device = bench.inventory.device(request.device_name)
    name, is_new = new_task(bench, request.session_name, request.initialization_behavior)
    task = task_named(bench, name)
    task.watchdog.update(device=device.name, TIMEOUT=request.timeout, reset_s=0.0, expired=False)
    return pb.CreateWatchdogTimerTaskExResponse(task=Session(name=name), new_session_initialized=is_new)


def has_expired(task: Task) -> bool:
    """Whether the timer has run out since it was started or reset last."""
    timeout = float(task.watchdog["TIMEOUT"])
    if task.state is State.RUNNING and timeout >= 0:
        since = max(task.watchdog["reset_s"], task.armed_s)
        elapsed = task.bench.clock.glance() - since
        task.watchdog["expired"] = bool(task.watchdog["expired"]) or elapsed > timeout
    return bool(task.watchdog["expired"])


def control_watchdog(bench: Bench, request: Any) -> Any:
    """Reset the timer, or clear what has expired."""
    task = task_named(bench, request.task.name)
    expired = has_expired(task)
    action = fields_of(request)["action"]
    if action != _RESET or not expired:
        task.watchdog["expired"] = False
        task.watchdog["reset_s"] = bench.clock.power_on()
    return pb.ControlWatchdogTaskResponse()


def _states_handler(rpc: str, attribute: str) -> Handler:
    reply = getattr(pb, f"{rpc}Response")

    def configure(bench: Bench, request: Any) -> Any:
        task = task_named(bench, request.task.name)
        fields = fields_of(request)
        names = [name.strip() for name in fields["channel_names"].split(",")]
        states = list(fields["expir_state_array"])
        for index, name in enumerate(names):
            task.watchdog[f"{attribute} {name.strip('/').lower()}"] = states[min(index, len(states) - 1)]
        kinds = list(
            getattr(request, "output_type_array_raw", ()) or getattr(request, "output_type_array", ())
        )
        for name, kind in zip(names, kinds, strict=False):
            task.watchdog[f"AO_OUTPUT_TYPE {name.lower()}"] = kind
        return reply()

    return configure


class WatchdogGroup:
    """Attributes of a watchdog; expiration states belong to lines."""

    def get(self, bench: Bench, request: Any, name: str) -> Any:
        task = self._task(bench, request)
        if name == "HAS_EXPIRED":
            if not task.is_reserved:
                raise DaqmxError(Code.GET_BEFORE_RESERVED, "Property: DAQmx_Watchdog_HasExpired")
            return has_expired(task)
        value = task.watchdog.get(self._key(request, name))
        return metadata.default_of("Watchdog", name) if value is None else value

    def set(self, bench: Bench, request: Any, name: str, value: Any) -> None:
        task = self._task(bench, request)
        if name not in metadata.resettable("Watchdog"):
            raise unsupported(f"Watchdog_{name}")
        task.watchdog[self._key(request, name)] = value

    def reset(self, bench: Bench, request: Any, name: str) -> None:
        task = self._task(bench, request)
        default = {"TIMEOUT": 10.0}
        task.watchdog.pop(self._key(request, name), None)
        task.watchdog.update({key: value for key, value in default.items() if key == name})

    @staticmethod
    def _key(request: Any, name: str) -> str:
        lines = str(getattr(request, "lines", ""))
        return f"{name} {lines.lower()}" if lines else name

    @staticmethod
    def _task(bench: Bench, request: Any) -> Task:
        task = task_named(bench, request.task.name)
        if "device" not in task.watchdog:
            raise DaqmxError(Code.INVALID_TASK, f"Task Name: {task.name}")
        return task


def watchdog_handlers() -> dict[str, Handler]:
    """RPC name → handler."""
    return {
        "CreateWatchdogTimerTaskEx": create_watchdog,
        "ControlWatchdogTask": control_watchdog,
        **{
            f"CfgWatchdog{io}ExpirStates": _states_handler(f"CfgWatchdog{io}ExpirStates", f"{io}_EXPIR_STATE")
            for io in ("AO", "CO", "DO")
        },
    }

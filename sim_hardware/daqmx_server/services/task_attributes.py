"""Attributes of tasks and of their timing, triggers, reads, buffers and exported signals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from nidaqmx.constants import (
    AcquisitionType,
    Edge,
    LoggingMode,
    LoggingOperation,
    OverwriteMode,
    ReadRelativeTo,
    SampleTimingType,
    WaitMode,
)

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.services.attributes import unsupported
from sim_hardware.daqmx_server.tasks.reading import default_count
from sim_hardware.daqmx_server.tasks.task import Task, task_named
from sim_hardware.daqmx_server.timing import triggers


class SettingsGroup:
    """Attributes that a task keeps as plain values, with defaults, and some that are derived.

    A default of None means: applicable, but there is no value until it is set (then −200452).
    """

    def __init__(
        self,
        settings: Callable[[Task], dict[str, Any]],
        defaults: dict[str, Any],
        derived: dict[str, Callable[[Task], Any]],
        while_running: frozenset[str] = frozenset(),
    ) -> None:
        self._settings = settings
        self._defaults = defaults
        self._derived = derived
        self._while_running = while_running

    def get(self, bench: Bench, request: Any, name: str) -> Any:
        task = task_named(bench, request.task.name)
        if name in self._derived:
            return self._derived[name](task)
        value = self._settings(task).get(name, self._defaults.get(name))
        if value is None:
            raise unsupported(name)
        return value

    def set(self, bench: Bench, request: Any, name: str, value: Any) -> None:
        task = self._changing(bench, request, name)
        self._settings(task)[name] = value

    def reset(self, bench: Bench, request: Any, name: str) -> None:
        task = self._changing(bench, request, name)
        self._settings(task).pop(name, None)

    def _changing(self, bench: Bench, request: Any, name: str) -> Task:
        task = task_named(bench, request.task.name)
        if name not in self._defaults:
            raise unsupported(name)
        if name not in self._while_running:
            task.configure()
        return task


def _samples_now(task: Task, of: str) -> int:
    if task.run is None:
        return 0
    now = task.bench.clock.glance()
    task.run.check(now)
    return task.run.available(now) if of == "available" else task.run.acquired(now)


def _overloads_exist(task: Task) -> bool:
    if not any(channel.overload_detection for channel in task.channels):
        raise unsupported("Read_OverloadedChansExist")
    task.overloads_reported = tuple(c.name for c in task.channels if c.name in task.overloads)
    task.overloads.clear()
    return bool(task.overloads_reported)


def _overloaded(task: Task) -> str:
    if not any(channel.overload_detection for channel in task.channels):
        raise unsupported("Read_OverloadedChans")
    return ", ".join(task.overloads_reported)


def _channels_to_read(task: Task) -> str:
    return str(task.reading.get("CHANNELS_TO_READ") or ", ".join(c.name for c in task.channels))


def _relative_to(task: Task) -> int:
    has_ref = task.trigger["REF_TRIG_TYPE"] != triggers.NONE
    default = ReadRelativeTo.FIRST_PRETRIGGER_SAMPLE if has_ref else ReadRelativeTo.CURRENT_READ_POSITION
    return int(task.reading.get("RELATIVE_TO", default.value))


READ: Final = SettingsGroup(
    lambda task: task.reading,
    defaults={
        "READ_ALL_AVAIL_SAMP": False,
        "AUTO_START": True,
        "OVERWRITE": OverwriteMode.DO_NOT_OVERWRITE_UNREAD_SAMPLES.value,
        "RELATIVE_TO": 0,
        "OFFSET": 0,
        "WAIT_MODE": WaitMode.SLEEP.value,
        "SLEEP_TIME": 0.001,
        "CHANNELS_TO_READ": "",
        "LOGGING_MODE": LoggingMode.OFF.value,
        "LOGGING_FILE_PATH": "",
        "LOGGING_PAUSE": False,
        "LOGGING_TDMS_GROUP_NAME": "",
        "LOGGING_TDMS_OPERATION": LoggingOperation.OPEN_OR_CREATE.value,
    },
    derived={
        "AVAIL_SAMP_PER_CHAN": lambda task: _samples_now(task, "available"),
        "TOTAL_SAMP_PER_CHAN_ACQUIRED": lambda task: _samples_now(task, "acquired"),
        "CURR_READ_POS": lambda task: 0 if task.run is None else task.run.read_position,
        "DEFAULT_NUMBER_OF_SAMPLES_TO_READ": default_count,
        "NUM_CHANS": lambda task: len(task.read_rows() or task.channels),
        "RAW_DATA_WIDTH": lambda task: sum(c.raw_bytes for c in task.channels),
        "CHANNELS_TO_READ": _channels_to_read,
        "RELATIVE_TO": _relative_to,
        "OVERLOADED_CHANS_EXIST": _overloads_exist,
        "OVERLOADED_CHANS": _overloaded,
    },
    while_running=frozenset(
        {
            "READ_ALL_AVAIL_SAMP",
            "OVERWRITE",
            "RELATIVE_TO",
            "OFFSET",
            "CHANNELS_TO_READ",
            "WAIT_MODE",
            "SLEEP_TIME",
            "LOGGING_PAUSE",
        }
    ),
)


def _sample_clock_terminal(task: Task) -> str:
    return f"/{task.hosts[0]}/ai/SampleClock" if task.hosts else ""


def _convert_rate(task: Task) -> float:
    period = task.timing.convert_period_s()
    if period == 0:
        raise unsupported("AIConv_Rate")
    return 1.0 / period


def _clocked(value: Callable[[Task], Any], name: str) -> Callable[[Task], Any]:
    def get(task: Task) -> Any:
        if not task.is_buffered:
            raise unsupported(name)
        return value(task)

    return get


TIMING: Final = SettingsGroup(
    lambda task: task.timing.settings,
    defaults={
        "SAMP_TIMING_TYPE": SampleTimingType.ON_DEMAND.value,
        "SAMP_QUANT_SAMP_MODE": AcquisitionType.FINITE.value,
        "SAMP_QUANT_SAMP_PER_CHAN": 1000,
        "SAMP_CLK_RATE": 1000.0,
        "SAMP_CLK_SRC": "",
        "SAMP_CLK_ACTIVE_EDGE": Edge.RISING.value,
        "REF_CLK_SRC": "",
        "AI_CONV_RATE": 0.0,
    },
    derived={
        "SAMP_CLK_RATE": _clocked(lambda task: task.timing.rate_hz, "SampClk_Rate"),
        "SAMP_CLK_MAX_RATE": lambda task: task.timing.max_rate_hz,
        "SAMP_CLK_SRC": _clocked(
            lambda task: task.timing.source if task.timing.source_is_foreign else "OnboardClock",
            "SampClk_Src",
        ),
        "SAMP_CLK_TERM": _clocked(_sample_clock_terminal, "SampClk_Term"),
        "SAMP_CLK_TIMEBASE_RATE": _clocked(lambda task: task.timing.timebase_hz, "SampClk_Timebase_Rate"),
        "AI_CONV_RATE": _convert_rate,
        "AI_CONV_MAX_RATE": lambda task: max(
            (c.product.aggregate_rate_hz or c.product.max_rate_hz for c in task.channels), default=0.0
        ),
    },
)


def _trigger_term(which: str) -> Callable[[Task], str]:
    def get(task: Task) -> str:
        if not task.hosts:
            raise unsupported(f"{which}Trig_Term")
        return f"/{task.hosts[0]}/ai/{which}Trigger"

    return get


TRIGGER: Final = SettingsGroup(
    lambda task: task.trigger,
    defaults={
        "START_TRIG_TYPE": triggers.NONE,
        "REF_TRIG_TYPE": triggers.NONE,
        "START_TRIG_DELAY": 0.0,
        "START_TRIG_DELAY_UNITS": 10364,
        "REF_TRIG_PRETRIG_SAMPLES": 2,
        **{f"DIG_EDGE_{which}_TRIG_SRC": "" for which in ("START", "REF")},
        **{f"DIG_EDGE_{which}_TRIG_EDGE": Edge.RISING.value for which in ("START", "REF")},
        **{f"ANLG_EDGE_{which}_TRIG_SRC": "" for which in ("START", "REF")},
        **{f"ANLG_EDGE_{which}_TRIG_SLOPE": Edge.RISING.value for which in ("START", "REF")},
        **{f"ANLG_EDGE_{which}_TRIG_LVL": 0.0 for which in ("START", "REF")},
        **{f"ANLG_EDGE_{which}_TRIG_HYST": 0.0 for which in ("START", "REF")},
        **{f"ANLG_WIN_{which}_TRIG_SRC": "" for which in ("START", "REF")},
        **{f"ANLG_WIN_{which}_TRIG_WHEN": 10163 for which in ("START", "REF")},
        **{f"ANLG_WIN_{which}_TRIG_TOP": 0.0 for which in ("START", "REF")},
        **{f"ANLG_WIN_{which}_TRIG_BTM": 0.0 for which in ("START", "REF")},
    },
    derived={"START_TRIG_TERM": _trigger_term("Start"), "REF_TRIG_TERM": _trigger_term("Reference")},
)

EXPORT: Final = SettingsGroup(
    lambda task: task.exported,
    defaults={"START_TRIG_OUTPUT_TERM": "", "REF_TRIG_OUTPUT_TERM": "", "SAMP_CLK_OUTPUT_TERM": ""},
    derived={},
)


class BufferGroup:
    """Size of the input buffer."""

    def get(self, bench: Bench, request: Any, name: str) -> int:
        task = task_named(bench, request.task.name)
        if name == "INPUT_BUF_SIZE":
            return task.buffer_size if task.is_buffered else 0
        if name == "INPUT_ONBRD_BUF_SIZE":
            return 127 if task.channels and task.channels[0].device.chassis else 4095
        raise unsupported(f"Buf_{name}")

    def set(self, bench: Bench, request: Any, name: str, value: int) -> None:
        task = self._changing(bench, request, name)
        task.input_buffer = int(value)

    def reset(self, bench: Bench, request: Any, name: str) -> None:
        self._changing(bench, request, name).input_buffer = None

    @staticmethod
    def _changing(bench: Bench, request: Any, name: str) -> Task:
        task = task_named(bench, request.task.name)
        if name != "INPUT_BUF_SIZE":
            raise unsupported(f"Buf_{name}")
        task.configure()
        return task


class TaskGroup:
    """Name, channels and devices of a task."""

    def get(self, bench: Bench, request: Any, name: str) -> Any:
        task = task_named(bench, request.task.name)
        if name == "COMPLETE":
            return task.is_done()
        values: dict[str, Any] = {
            "NAME": task.name,
            "CHANNELS": ", ".join(channel.name for channel in task.channels),
            "NUM_CHANS": len(task.channels),
            "DEVICES": ", ".join(task.devices),
            "NUM_DEVICES": len(task.devices),
        }
        return values[name]

    def set(self, bench: Bench, request: Any, name: str, value: Any) -> None:
        raise unsupported(f"Task_{name}")

    def reset(self, bench: Bench, request: Any, name: str) -> None:
        raise unsupported(f"Task_{name}")

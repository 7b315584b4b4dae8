"""Attributes of tasks and of their timing, reads, writes and buffers."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final
from weakref import WeakKeyDictionary

from nidaqmx import constants
from nidaqmx.constants import Edge, ReadRelativeTo, SampleTimingType

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels import metadata
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.inventory.devices import channel_list
from sim_hardware.daqmx_server.inventory.terminals import full_name
from sim_hardware.daqmx_server.services.attributes.groups import unsupported
from sim_hardware.daqmx_server.services.attributes.settings import SettingsGroup
from sim_hardware.daqmx_server.services.attributes.timestamps import event_stamp, is_stamped
from sim_hardware.daqmx_server.tasks.checks import refuse_while_logging
from sim_hardware.daqmx_server.tasks.needs import ONBOARD_OUTPUT_SAMPLES
from sim_hardware.daqmx_server.tasks.reading import default_count
from sim_hardware.daqmx_server.tasks.task import Task, task_named
from sim_hardware.daqmx_server.timing import triggers


def _samples_now(task: Task, of: str) -> int:
    if task.run is None:
        return 0
    now = task.bench.clock.glance()
    task.look()
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


def line_bytes(task: Task) -> int:
    """Bytes per channel of a read or write by lines: one per line of the widest channel."""
    return max((len(channel.lines) for channel in task.channels), default=0)


_EXIST: Final = "_EXIST"


class _ReadGroup(SettingsGroup):
    """Attributes of reading; a strict driver refuses some while it logs.

    Which channels have a fault is told only after the question whether any has (−201194).
    """

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        super().__init__(*arguments, **keywords)
        self._asked: WeakKeyDictionary[Task, set[str]] = WeakKeyDictionary()

    def get(self, bench: Bench, request: Any, name: str) -> Any:
        task = task_named(bench, request.task.name)
        known = self._asked.setdefault(task, set())
        question = f"{name.removesuffix('_DETAILS')}{_EXIST}"
        if question in metadata.attributes_of("Read") and question not in known:
            raise DaqmxError(Code.TWO_PART_ORDER, f"Property: DAQmx_Read_{name}")
        value = super().get(bench, request, name)
        if name.endswith(_EXIST):
            known.add(name)
        return value

    def set(self, bench: Bench, request: Any, name: str, value: Any) -> None:
        if name in ("OVERWRITE", "RELATIVE_TO", "OFFSET"):
            refuse_while_logging(task_named(bench, request.task.name), name)
        super().set(bench, request, name, value)


READ: Final = _ReadGroup(
    "Read",
    lambda task: task.reading,
    defaults={
        "AUTO_START": True,
        "OVERWRITE": constants.OverwriteMode.DO_NOT_OVERWRITE_UNREAD_SAMPLES.value,
        "WAIT_MODE": constants.WaitMode.SLEEP.value,
        "SLEEP_TIME": 0.001,
        "LOGGING_MODE": constants.LoggingMode.OFF.value,
        "LOGGING_TDMS_OPERATION": constants.LoggingOperation.OPEN_OR_CREATE.value,
        "LOGGING_FILE_WRITE_SIZE": 4_294_967_295,
    },
    derived={
        "AVAIL_SAMP_PER_CHAN": lambda task: _samples_now(task, "available"),
        "TOTAL_SAMP_PER_CHAN_ACQUIRED": lambda task: _samples_now(task, "acquired"),
        "CURR_READ_POS": lambda task: 0 if task.run is None else task.run.read_position,
        "DEFAULT_NUMBER_OF_SAMPLES_TO_READ": default_count,
        "NUM_CHANS": lambda task: len(task.read_rows() or task.channels),
        "RAW_DATA_WIDTH": lambda task: sum(c.raw_bytes for c in task.channels),
        "DIGITAL_LINES_BYTES_PER_CHAN": line_bytes,
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
            "LOGGING_FILE_PATH",
        }
    ),
)


def _generated(task: Task) -> int:
    return 0 if task.run is None else task.run.acquired(task.bench.clock.glance())


def _space(task: Task) -> int:
    return max((task.output_buffer or task.buffer_size) - task.generation.written + _generated(task), 0)


WRITE: Final = SettingsGroup(
    "Write",
    lambda task: task.writing,
    defaults={
        "REGEN_MODE": constants.RegenerationMode.ALLOW_REGENERATION.value,
        "RELATIVE_TO": constants.WriteRelativeTo.CURRENT_WRITE_POSITION.value,
        "WAIT_MODE": constants.WaitMode.SLEEP.value,
        "SLEEP_TIME": 0.001,
    },
    derived={
        "NUM_CHANS": lambda task: len(task.channels),
        "RAW_DATA_WIDTH": lambda task: sum(c.raw_bytes for c in task.channels),
        "DIGITAL_LINES_BYTES_PER_CHAN": line_bytes,
        "CURR_WRITE_POS": lambda task: task.generation.written,
        "TOTAL_SAMP_PER_CHAN_GENERATED": _generated,
        "SPACE_AVAIL": _space,
    },
    while_running=frozenset({"RELATIVE_TO", "OFFSET", "WAIT_MODE", "SLEEP_TIME", "NEXT_WRITE_IS_LAST"}),
)


def engine_terminal(name: str) -> Callable[[Task], str]:
    """A terminal of the task's own engine, such as ``/Dev1/ai/SampleClock``."""

    def get(task: Task) -> str:
        if not task.hosts:
            raise unsupported(f"{name}_Term")
        return f"/{task.hosts[0]}/{task.io.lower()}/{name}"

    return get


def _source(task: Task) -> str:
    """The sample clock's source in NI's spelling; −89120 for a terminal that no device has."""
    host = task.host
    if host is None or not task.timing.source_is_foreign:
        on_card = host is not None and not host.is_chassis
        return engine_terminal("SampleClockTimebase")(task) if on_card else "OnboardClock"
    return full_name(task.bench.inventory, host, task.timing.source, Code.SOURCE_TERMINAL_UNKNOWN)


def _timebase_source(task: Task) -> str:
    """Where the sample clock is divided from, in NI's spelling; −89120 for a terminal that no device has."""
    given, host = str(task.timing.settings.get("SAMP_CLK_TIMEBASE_SRC", "")), task.host
    if not given or host is None:
        return engine_terminal("SampleClockTimebase")(task)
    return full_name(task.bench.inventory, host, given, Code.SOURCE_TERMINAL_UNKNOWN)


def _count(task: Task) -> int:
    task.timing.verify_count()
    return task.timing.samples_per_channel


def _convert_period(task: Task) -> float:
    period = task.timing.convert_period_s()
    if period == 0:
        raise unsupported("AIConv_Rate")
    return period


def _convert_divisor(task: Task) -> int:
    """Divisor of the timebase that makes the convert clock, never faster than asked."""
    set_to = task.timing.settings.get("AI_CONV_TIMEBASE_DIV")
    if set_to is not None:
        return int(set_to)
    return math.floor(_convert_period(task) * task.timing.timebase_hz * (1 + 1e-12)) + 1


def _lines(name: str) -> Callable[[Task], str]:
    return lambda task: ", ".join(channel_list(str(task.timing.settings.get(name, ""))))


TIMING: Final = SettingsGroup(
    "Timing",
    lambda task: task.timing.settings,
    defaults={
        "SAMP_TIMING_TYPE": SampleTimingType.ON_DEMAND.value,
        "SAMP_QUANT_SAMP_MODE": constants.AcquisitionType.FINITE.value,
        "SAMP_CLK_ACTIVE_EDGE": Edge.RISING.value,
        "AI_CONV_ACTIVE_EDGE": Edge.RISING.value,
        "FIRST_SAMP_TIMESTAMP_TIMESCALE": constants.Timescale.USE_HOST.value,
        "FIRST_SAMP_CLK_TIMESCALE": constants.Timescale.USE_HOST.value,
    },
    derived={
        "SAMP_QUANT_SAMP_PER_CHAN": _count,
        "SAMP_CLK_RATE": lambda task: task.timing.rate_hz,
        "SAMP_CLK_MAX_RATE": lambda task: task.timing.max_rate_hz,
        "SAMP_CLK_SRC": _source,
        "SAMP_CLK_TERM": engine_terminal("SampleClock"),
        "SAMP_CLK_TIMEBASE_RATE": lambda task: task.timing.timebase_hz,
        "SAMP_CLK_TIMEBASE_SRC": _timebase_source,
        "SAMP_CLK_TIMEBASE_DIV": lambda task: round(task.timing.timebase_hz / task.timing.rate_hz),
        "AI_CONV_RATE": lambda task: 1.0 / _convert_period(task),
        "AI_CONV_TIMEBASE_DIV": _convert_divisor,
        "AI_CONV_MAX_RATE": lambda task: max(
            (c.product.aggregate_rate_hz or c.product.max_rate_hz for c in task.timing.inputs), default=0.0
        ),
        "FIRST_SAMP_TIMESTAMP_ENABLE": lambda task: is_stamped(task, "FIRST_SAMP"),
        "FIRST_SAMP_TIMESTAMP_VAL": event_stamp("FIRST_SAMP"),
        "CHANGE_DETECT_DI_RISING_EDGE_PHYSICAL_CHANS": _lines("CHANGE_DETECT_DI_RISING_EDGE_PHYSICAL_CHANS"),
        "CHANGE_DETECT_DI_FALLING_EDGE_PHYSICAL_CHANS": _lines(
            "CHANGE_DETECT_DI_FALLING_EDGE_PHYSICAL_CHANS"
        ),
    },
)


REAL_TIME: Final = SettingsGroup("RealTime", lambda task: task.real_time, defaults={}, derived={})


class BufferGroup:
    """Sizes of the buffers."""

    def get(self, bench: Bench, request: Any, name: str) -> int:
        task = task_named(bench, request.task.name)
        if name == "INPUT_BUF_SIZE":
            return task.buffer_size if task.is_buffered else 0
        if name == "OUTPUT_BUF_SIZE":
            return task.output_buffer or task.buffer_size
        if name == "INPUT_ONBRD_BUF_SIZE":
            return 127 if task.channels and task.channels[0].device.chassis else 4095
        return ONBOARD_OUTPUT_SAMPLES

    def set(self, bench: Bench, request: Any, name: str, value: int) -> None:
        task = self._changing(bench, request, name)
        if name == "INPUT_BUF_SIZE":
            task.input_buffer = int(value)
        else:
            task.output_buffer = int(value)

    def reset(self, bench: Bench, request: Any, name: str) -> None:
        task = self._changing(bench, request, name)
        if name == "INPUT_BUF_SIZE":
            task.input_buffer = None
        else:
            task.output_buffer = None

    @staticmethod
    def _changing(bench: Bench, request: Any, name: str) -> Task:
        task = task_named(bench, request.task.name)
        if name != ("OUTPUT_BUF_SIZE" if task.is_output else "INPUT_BUF_SIZE"):
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

"""Attributes of triggers and exported signals, with terminals in NI's spelling."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from nidaqmx import constants
from nidaqmx.constants import Edge

from sim_hardware.daqmx_server.channels import metadata
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.inventory.devices import channel_list
from sim_hardware.daqmx_server.inventory.terminals import full_name
from sim_hardware.daqmx_server.services.attributes.settings import SettingsGroup
from sim_hardware.daqmx_server.services.attributes.tasks import engine_terminal
from sim_hardware.daqmx_server.services.attributes.timestamps import event_stamp
from sim_hardware.daqmx_server.tasks.task import Task
from sim_hardware.daqmx_server.timing import triggers


def _trigger_source(name: str) -> Callable[[Task], str]:
    """Source of a digital edge in NI's spelling; as it was given where no device has it."""

    return lambda task: _known_name(task, str(task.trigger.get(name, "")))


def _known_name(task: Task, given: str) -> str:
    """A terminal in NI's spelling; as it was given where no device has it."""
    host = task.host
    try:
        return given if host is None else full_name(task.bench.inventory, host, given, Code.INVALID_VALUE)
    except DaqmxError:
        return given


TRIGGER: Final = SettingsGroup(
    "Trig",
    lambda task: task.trigger,
    defaults={
        "START_TRIG_TYPE": triggers.NONE,
        "REF_TRIG_TYPE": triggers.NONE,
        "PAUSE_TRIG_TYPE": triggers.NONE,
        "ARM_START_TRIG_TYPE": triggers.NONE,
        "ADV_TRIG_TYPE": triggers.NONE,
        "HSHK_TRIG_TYPE": triggers.NONE,
        "START_TRIG_DELAY_UNITS": constants.DigitalWidthUnits.SAMPLE_CLOCK_PERIODS.value,
        "REF_TRIG_PRETRIG_SAMPLES": 2,
        **{f"DIG_EDGE_{which}_TRIG_EDGE": Edge.RISING.value for which in ("START", "REF")},
        **{f"ANLG_EDGE_{which}_TRIG_SLOPE": Edge.RISING.value for which in ("START", "REF")},
        **{
            f"ANLG_{kind}_TRIG_COUPLING": constants.Coupling.DC.value
            for kind in ("EDGE_START", "EDGE_REF", "WIN_START", "WIN_REF", "LVL_PAUSE", "WIN_PAUSE")
        },
        **{f"ANLG_WIN_{which}_TRIG_WHEN": 10163 for which in ("START", "REF")},
        **{
            f"{which}_TIMESCALE": constants.Timescale.USE_HOST.value
            for which in (
                "START_TRIG_TIMESTAMP",
                "REF_TRIG_TIMESTAMP",
                "ARM_START_TRIG_TIMESTAMP",
                "START_TRIG",
                "ARM_START_TRIG",
            )
        },
    },
    derived={
        "START_TRIG_TERM": engine_terminal("StartTrigger"),
        "REF_TRIG_TERM": engine_terminal("ReferenceTrigger"),
        **{
            f"{kind}_{which}_TRIG_SRC": _trigger_source(f"{kind}_{which}_TRIG_SRC")
            for kind in ("DIG_EDGE", "ANLG_EDGE", "ANLG_WIN")
            for which in ("START", "REF")
        },
        "START_TRIG_TIMESTAMP_VAL": event_stamp("START_TRIG"),
        "REF_TRIG_TIMESTAMP_VAL": event_stamp("REF_TRIG"),
        "ARM_START_TRIG_TIMESTAMP_VAL": event_stamp("ARM_START_TRIG"),
    },
)


def _exported_to(name: str) -> Callable[[Task], str]:
    """Terminals that a signal is exported to, in NI's spelling where a device has them."""
    return lambda task: ", ".join(
        _known_name(task, term) for term in channel_list(str(task.exported.get(name, "")))
    )


EXPORT: Final = SettingsGroup(
    "ExportedSignal",
    lambda task: task.exported,
    defaults={},
    derived={
        name: _exported_to(name)
        for name in metadata.attributes_of("ExportedSignal")
        if name.endswith("_OUTPUT_TERM")
    },
)

"""What sensors and converters say of themselves: electronic data sheets (TEDS) and timing modes."""

from __future__ import annotations

from collections.abc import Iterable

import nidaqmx
import nidaqmx.system
from nidaqmx import errors as ni_errors
from nidaqmx.system.physical_channel import PhysicalChannel

from daq_app.config.planning.plan import PlannedTask, TaskPlan
from drivers.protocol import DataSheet


def read_data_sheets(system: nidaqmx.system.System, plan: TaskPlan) -> dict[str, DataSheet]:
    """Channel id → data sheet of its sensor, for the sensors that have one.

    Asked before the tasks take the modules: a module searches for sensors only while it is free. A sheet
    that somebody gave to the terminal (a virtual one) is kept.
    """
    sheets: dict[str, DataSheet] = {}
    asks: dict[str, bool] = {}
    for task in plan.tasks:
        for item in task.channels:
            name, _, terminal = item.channel.physical_channel.partition("/")
            device = system.devices[name]
            if name not in asks:
                asks[name] = _asks_its_sensors(device)
            sheet = _data_sheet(device.ai_physical_chans[terminal], search=asks[name])
            if sheet is not None:
                sheets[item.channel.id] = sheet
    return sheets


def _asks_its_sensors(device: nidaqmx.system.Device) -> bool:
    try:
        return bool(device.hwteds_supported)
    except ni_errors.DaqError:
        return False


def _data_sheet(terminal: PhysicalChannel, *, search: bool) -> DataSheet | None:
    try:
        return _known_sheet(terminal)
    except ni_errors.DaqError:
        if not search:
            return None
    try:
        terminal.configure_teds()
        return _known_sheet(terminal)
    except ni_errors.DaqError:
        return None  # no sensor there, or one without a data sheet


def _known_sheet(terminal: PhysicalChannel) -> DataSheet:
    return DataSheet(
        int(terminal.teds_mfg_id),
        int(terminal.teds_model_num),
        f"{terminal.teds_version_letter}{terminal.teds_version_num}",
        int(terminal.teds_serial_num),
    )


def read_timing_modes(tasks: Iterable[tuple[nidaqmx.Task, PlannedTask]]) -> dict[str, str]:
    """Channel id → timing mode of its converter, in NI's words; nothing for modules without modes."""
    modes: dict[str, str] = {}
    without: set[str] = set()
    for task, planned in tasks:
        for item, created in zip(planned.channels, task.ai_channels, strict=True):
            device = item.channel.physical_channel.partition("/")[0]
            if device in without:
                continue
            try:
                modes[item.channel.id] = str(created.ai_adc_timing_mode.name)
            except ni_errors.DaqError:
                without.add(device)
    return modes

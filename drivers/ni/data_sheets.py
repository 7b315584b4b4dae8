"""What sensors and converters say of themselves: electronic data sheets (TEDS) and timing modes."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable

import nidaqmx
import nidaqmx.system
from nidaqmx import errors as ni_errors
from nidaqmx.system.physical_channel import PhysicalChannel

from daq_app.config.planning.plan import PlannedTask, TaskPlan
from drivers.ni.tasks import virtual_name
from drivers.protocol import DataSheet


def read_data_sheets(system: nidaqmx.system.System, plan: TaskPlan) -> dict[str, DataSheet]:
    """Channel id → data sheet of its sensor, for the sensors that have one.

    Only modules that ask their sensors are asked, before the tasks take them: a module searches for sensors
    only while it is free. A sheet that somebody gave to the terminal (a virtual one) is kept.
    """
    terminals: dict[str, list[tuple[str, str]]] = {}
    for task in plan.tasks:
        for item in task.channels:
            device_name, _, terminal = item.channel.physical_channel.partition("/")
            terminals.setdefault(device_name, []).append((item.channel.id, terminal))
    sheets: dict[str, DataSheet] = {}
    for device_name, places in terminals.items():
        device = system.devices[device_name]
        if not _asks_its_sensors(device):
            continue
        for channel_id, terminal in places:
            sheet = _data_sheet(device.ai_physical_chans[terminal])
            if sheet is not None:
                sheets[channel_id] = sheet
    return sheets


def _asks_its_sensors(device: nidaqmx.system.Device) -> bool:
    try:
        return bool(device.hwteds_supported)
    except ni_errors.DaqError:
        return False


def _data_sheet(terminal: PhysicalChannel) -> DataSheet | None:
    with contextlib.suppress(ni_errors.DaqError):
        return _known_sheet(terminal)
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
        for item in planned.channels:
            device = item.channel.physical_channel.partition("/")[0]
            if device in without:
                continue
            try:
                mode = task.ai_channels[virtual_name(item.channel)].ai_adc_timing_mode
            except ni_errors.DaqError:
                without.add(device)
            else:
                modes[item.channel.id] = str(mode.name)
    return modes

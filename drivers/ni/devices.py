"""Devices before any task is made: which there are, and whether those of the plan are among them."""

from __future__ import annotations

from collections.abc import Callable

import nidaqmx.system
from nidaqmx.constants import BusType, ProductCategory

from daq_app.config.hardware.max_file import ListedDevice
from daq_app.config.planning.plan import TaskPlan
from drivers.ni.connection import Connection
from drivers.ni.error_advice import translate
from drivers.protocol import DeviceInfo, DriverError

Inspection = Callable[[tuple[DeviceInfo, ...]], list[str]]
"""Looks at the devices before any task is made; one sentence for each that is not as it should be."""


def check_devices(
    connection: Connection, plan: TaskPlan, object_to: Inspection | None
) -> tuple[DeviceInfo, ...]:
    """What sits where the plan expects it; one error that lists all missing devices."""
    present = {device.name: device for device in connection.system().devices}
    wanted = sorted(
        {item.channel.physical_channel.split("/")[0] for task in plan.tasks for item in task.channels}
    )
    missing = [name for name in wanted if name not in present]
    if missing:
        there = ", ".join(sorted(present)) or "none"
        raise DriverError(
            f"{'Devices are' if len(missing) > 1 else 'A device is'} missing: {', '.join(missing)}. "
            f"Present: {there}",
            advice="Check that the chassis is switched on and every module sits in its slot, and compare "
            "the names in the rig file with those in NI MAX",
            code=-200220,
            device=missing[0],
        )
    devices = tuple(
        DeviceInfo(
            name=name,
            product=str(present[name].product_type),
            serial=f"{int(present[name].serial_num):08X}",
            simulated=bool(present[name].is_simulated),
        )
        for name in wanted
    )
    objections = object_to(devices) if object_to is not None else []
    if objections:
        raise DriverError(
            "The hardware is not what the rig file says: " + "; ".join(objections),
            advice="Nothing was started",
        )
    return devices


def list_devices(connection: str) -> list[ListedDevice]:
    """Every device that NI-DAQmx knows at a connection. Raises `DriverError`."""
    way = Connection(connection)
    way.limit_calls_to()
    try:
        return [_listed(device) for device in way.system().devices]
    except Exception as error:
        raise translate(error, doing="listing the devices") from error
    finally:
        way.close()


def reserve_chassis(connection: str, name: str, *, override: bool) -> None:
    """Reserve a network chassis for this computer; with `override` also from another computer.

    Raises `DriverError`, with the code −201420 where another computer has it and `override` is false.
    """
    way = Connection(connection)
    way.limit_calls_to()
    try:
        way.system().devices[name].reserve_network_device(override_reservation=override)
    except Exception as error:
        raise translate(error, doing=f"reserving {name}") from error
    finally:
        way.close()


def _listed(device: nidaqmx.system.Device) -> ListedDevice:
    category = device.product_category
    chassis, slot = "", 0
    if category is ProductCategory.C_SERIES_MODULE:
        chassis, slot = str(device.compact_daq_chassis_device.name), int(device.compact_daq_slot_num)
    elif device.bus_type in (BusType.PXI, BusType.PXIE):
        chassis, slot = f"PXI{int(device.pxi_chassis_num)}", int(device.pxi_slot_num)
    serial = int(device.serial_num)
    return ListedDevice(
        name=str(device.name),
        product=str(device.product_type),
        serial=f"{serial:08X}" if serial else "",
        chassis=chassis,
        slot=slot,
        is_chassis=category is ProductCategory.COMPACT_DAQ_CHASSIS,
        simulated=bool(device.is_simulated),
    )

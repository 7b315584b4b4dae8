"""Before any task is made: is every device of the plan there, and the right one?"""

from __future__ import annotations

from collections.abc import Callable

from daq_app.config.planning.plan import TaskPlan
from drivers.connection import Connection
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

"""From the word in the rig file to the driver."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from drivers.ni.ledger import TaskLedger
from drivers.protocol import DeviceInfo

if TYPE_CHECKING:
    from drivers.ni.nidaqmx_driver import NidaqmxDriver


def open_driver(
    connection: str,
    *,
    backup_folder: PurePath | None = None,
    ledger: Path | None = None,
    object_to: Callable[[tuple[DeviceInfo, ...]], list[str]] | None = None,
    clock_speed: float = 1.0,
) -> NidaqmxDriver:
    """The driver for ``local`` (the NI driver of this machine) or ``grpc://HOST:PORT``.

    `backup_folder` switches on the second recorder: TDMS files that the NI driver itself writes. `ledger`
    is a file that tells the next session which tasks this one had open, should it be killed. `object_to`
    looks at the devices before anything is reserved and answers a sentence for each that is wrong.
    `clock_speed` is how much faster than real time a simulated device runs.
    Raises `DriverError` for a connection that is none. Nothing is reserved before `open`.
    """
    # Imported here: nidaqmx takes a second to load, and replay needs none of it.
    from drivers.ni.nidaqmx_driver import NidaqmxDriver

    kept = TaskLedger(ledger) if ledger is not None else None
    return NidaqmxDriver(
        connection,
        backup_folder=backup_folder,
        ledger=kept,
        object_to=object_to,
        clock_speed=clock_speed,
    )

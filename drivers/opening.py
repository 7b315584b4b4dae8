"""From the word in the rig file to the driver."""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from drivers.nidaqmx_driver import NidaqmxDriver


def open_driver(connection: str, *, backup_folder: PurePath | None = None) -> NidaqmxDriver:
    """The driver for ``local`` (the NI driver of this machine) or ``grpc://HOST:PORT``.

    `backup_folder` switches on the second recorder: TDMS files that the NI driver itself writes.
    Raises `DriverError` for a connection that is none. Nothing is reserved before `open`.
    """
    # Imported here: nidaqmx takes a second to load, and replay needs none of it.
    from drivers.nidaqmx_driver import NidaqmxDriver

    return NidaqmxDriver(connection, backup_folder=backup_folder)

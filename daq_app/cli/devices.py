"""Devices that a command line names: at a connection, or in an export of NI MAX."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from daq_app.config.hardware.max_file import ListedDevice, listed_in_export


def devices_at(connection: str) -> list[ListedDevice]:
    """The devices that NI-DAQmx finds at a connection. Raises `DriverError`."""
    _require(connection)
    from drivers.ni.devices import list_devices

    return list_devices(connection)


def product_at(connection: str, device: str) -> dict[str, Any]:
    """The table of a product file that a device's attributes make. Raises `DriverError`."""
    _require(connection)
    from drivers.ni.product_copy import describe_product

    return describe_product(connection, device)


def reserve_at(connection: str, chassis: str, *, override: bool) -> None:
    """Reserve a network chassis for the computer of NI-DAQmx. Raises `DriverError`."""
    _require(connection)
    from drivers.ni.devices import reserve_chassis

    reserve_chassis(connection, chassis, override=override)


def _require(connection: str) -> None:
    """NI-DAQmx must be there before its client is loaded, which takes a second."""
    from drivers.ni.local_library import require_ni_daqmx

    if connection == "local":
        require_ni_daqmx()


def devices_of(source: str) -> list[ListedDevice]:
    """The devices of ``EXPORT.ini`` or at a connection. Raises `ConfigError` or `DriverError`."""
    if source == "local" or "://" in source:
        return devices_at(source)
    return listed_in_export(Path(source))

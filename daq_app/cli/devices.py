"""Devices that a command line names: at a connection, or in an export of NI MAX."""

from __future__ import annotations

from pathlib import Path

from daq_app.config.hardware.max_file import ListedDevice, listed_in_export


def devices_at(connection: str) -> list[ListedDevice]:
    """The devices that NI-DAQmx finds at a connection. Raises `DriverError`."""
    from drivers.local_library import require_ni_daqmx

    if connection == "local":
        require_ni_daqmx()
    from drivers.devices import list_devices

    return list_devices(connection)


def devices_of(source: str) -> list[ListedDevice]:
    """The devices of ``EXPORT.ini`` or at a connection. Raises `ConfigError` or `DriverError`."""
    if source == "local" or "://" in source:
        return devices_at(source)
    return listed_in_export(Path(source))

"""The seam to the hardware: one protocol, and the drivers that keep it."""

from drivers.opening import open_driver
from drivers.protocol import BackupRecorder, Block, ClockReading, DeviceInfo, Driver, DriverError, Opened
from drivers.replay import Recording, ReplayDriver

__all__ = [
    "BackupRecorder",
    "Block",
    "ClockReading",
    "DeviceInfo",
    "Driver",
    "DriverError",
    "Opened",
    "Recording",
    "ReplayDriver",
    "open_driver",
]

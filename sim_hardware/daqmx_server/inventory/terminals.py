"""Names of terminals: which there are on a device, and their full form."""

from __future__ import annotations

import re
from typing import Final

from nidaqmx.constants import ProductCategory

from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.inventory.devices import Device, Inventory

_SIGNALS: Final = ("SampleClock", "StartTrigger", "ReferenceTrigger", "PauseTrigger", "SampleClockTimebase")
_ENGINES: Final = ("ai", "ao", "di", "do", "te0", "te1", "te2", "te3")
_SINGLE: Final = (
    "100kHzTimebase",
    "10MHzRefClock",
    "12.8MHzTimebase",
    "13.1072MHzTimebase",
    "20MHzTimebase",
    "80MHzTimebase",
    "100MHzTimebase",
    "AnalogComparisonEvent",
    "ChangeDetectionEvent",
    "FrequencyOutput",
    "OnboardClock",
    "PairedCtrInternalOutput",
    "PXI_Clk10",
    "PXIe_Clk100",
    "PXI_Star",
    "WatchdogExpiredEvent",
    "WatchdogExpirationTrigger",
)
_NUMBERED: Final = (
    ("PFI", 16),
    ("APFI", 2),
    ("RTSI", 8),
    ("PXI_Trig", 8),
    ("PXIe_DStarA", 1),
    ("PXIe_DStarB", 1),
    ("Sync", 2),
)
_CTR: Final = (
    "InternalOutput",
    "Source",
    "Gate",
    "Aux",
    "Out",
    "A",
    "B",
    "Z",
    "SampleClock",
    "ArmStartTrigger",
)


def plain(terminal: str) -> str:
    """Terminals compare without case and without the leading slash."""
    return terminal.lower().strip("/")


def terminals_on(device: Device) -> list[str]:
    """Terminals of a device that has clocks of its own, in NI's spelling, without the device."""
    counters = device.product.counters.n if device.product else 4
    names = [f"{engine}/{signal}" for engine in _ENGINES for signal in _SIGNALS]
    names += ["ai/ConvertClock", "ai/ConvertClockTimebase", "ai/HoldCompleteEvent", *_SINGLE]
    names += [f"{stem}{i}" for stem, count in _NUMBERED for i in range(count)]
    return names + [f"Ctr{i}{part}" for i in range(max(counters, 4)) for part in _CTR]


def full_name(inventory: Inventory, host: Device, terminal: str, wrong: Code) -> str:
    """``PFI0`` → ``/Dev1/PFI0``, in NI's spelling; raises `wrong` for a terminal that does not exist.

    A terminal of another device keeps its device. High-speed digital cards show names as they were given.
    """
    if not terminal or host.category is ProductCategory.DIGITAL_IO:
        return terminal
    owner, rest = host, terminal.strip("/")
    first, _, tail = rest.partition("/")
    for known in inventory.devices.values():
        if tail and known.name.lower() == first.lower():
            owner, rest = known, tail
    for name in terminals_on(owner):
        if name.lower() == rest.lower():
            return f"/{owner.name}/{name}"
    if re.fullmatch(r"pfi\d+|port\d+/line\d+", rest.lower()) and owner.is_chassis:
        return f"/{owner.name}/{rest}"
    raise DaqmxError(wrong, f"Property: DAQmx_Terminal\nRequested Value: {terminal}", f"Device: {owner.name}")

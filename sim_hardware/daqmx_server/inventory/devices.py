"""What hardware the simulated driver finds: chassis, modules, stand-alone devices."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from nidaqmx.constants import BusType, ProductCategory
from nidaqmx.utils import unflatten_channel_string

from daq_app.config.hardware import catalogue
from daq_app.config.hardware.products import ChassisProduct, Product
from daq_app.config.rig import Rig
from sim_hardware.daqmx_server.errors import Code, DaqmxError

_TERMINAL = re.compile(r"^/?(?P<device>[^/]+)/(?P<rest>.+)$")


@dataclass(frozen=True, slots=True)
class Device:
    """One name in NI MAX: a chassis, a module in it, or a stand-alone board.

    `product` is None for a chassis and for a product without simulated inputs.
    """

    name: str
    product_name: str
    product: Product | None = None
    serial: int = 0
    product_number: int = 0
    chassis: str = ""
    """Name of the cDAQ chassis that the module sits in and that owns its clocks."""
    slot: int = 0
    is_chassis: bool = False
    bus: BusType = BusType.UNKNOWN
    category: ProductCategory = ProductCategory.UNKNOWN
    networked: bool = False
    """A chassis that shares its time with others over the network."""
    timing_engines: int | None = None
    """AI tasks that a chassis can time at once."""

    @property
    def physical_channels(self) -> tuple[str, ...]:
        return tuple(f"{self.name}/ai{i}" for i in range(self.product.n_ai)) if self.product else ()


@dataclass(slots=True)
class Inventory:
    """Devices by name, in the order of NI MAX."""

    devices: dict[str, Device] = field(default_factory=dict)

    def add(self, device: Device) -> None:
        self.devices[device.name] = device

    @classmethod
    def from_rig(cls, rig: Rig) -> Inventory:
        """Chassis and modules of a rig file. Raises `catalogue.UnknownProduct`.

        A PXI chassis is no device of NI-DAQmx: its cards stand for themselves.
        """
        inventory = cls()
        for entry in rig.hardware.chassis:
            chassis = catalogue.chassis(entry.product)
            if chassis.bus == "cdaq":
                inventory.add(cdaq_chassis(entry.name, chassis))
            for item in entry.modules:
                product = catalogue.module(item.product)
                name = item.name or catalogue.device_name(entry.name, chassis.bus, item.slot)
                serial = int(item.serial, 16) if re.fullmatch(r"[0-9A-Fa-f]{1,8}", item.serial) else 0
                owner = entry.name if chassis.bus == "cdaq" else ""
                inventory.add(module_device(name, product, owner, item.slot, serial))
        return inventory

    def device(self, name: str) -> Device:
        """Case-insensitive, as in NI-DAQmx; −200220 if there is none."""
        wanted = name.strip().strip("/").lower()
        for known, device in self.devices.items():
            if known.lower() == wanted:
                return device
        raise DaqmxError(Code.INVALID_DEVICE, f"Device Specified: {name.strip()}")

    def physical_channel(self, name: str) -> tuple[Device, int]:
        """Device and channel number of ``cDAQ1Mod1/ai3``; −200220, −200430 or −200170."""
        match = _TERMINAL.match(name.strip())
        device = self.device(match["device"] if match else name)
        terminal = match["rest"].lower() if match else ""
        if device.product is not None:
            number = re.fullmatch(r"ai(\d+)", terminal)
            if number and int(number[1]) < device.product.n_ai:
                return device, int(number[1])
        raise DaqmxError(
            Code.PHYSICAL_CHANNEL_UNKNOWN,
            f"Device Specified: {device.name}",
            f"Physical Channel Name: {terminal or name}",
        )

    def host_of(self, device: Device) -> str:
        """The device that owns clocks and triggers: the chassis of a module, else the device itself."""
        return device.chassis or device.name


def cdaq_chassis(name: str, product: ChassisProduct | str, serial: int = 0, number: int = 0) -> Device:
    """The device of a cDAQ chassis; one that the catalogue lacks has three timing engines."""
    known = product if isinstance(product, ChassisProduct) else catalogue.CHASSIS.get(product)
    product_name = product if isinstance(product, str) else product.name
    ethernet = re.search(r"9184|9185|9188|9189|9191", product_name) is not None
    return Device(
        name,
        product_name,
        serial=serial,
        product_number=number,
        is_chassis=True,
        bus=BusType.TCPIP if ethernet else BusType.USB,
        category=ProductCategory.COMPACT_DAQ_CHASSIS,
        networked=known is not None and known.network_synchronised,
        timing_engines=known.ai_timing_engines if known else 3,
    )


def module_device(
    name: str, product: Product | str, chassis: str, slot: int, serial: int = 0, number: int = 0
) -> Device:
    """The device of a C Series module or of a card."""
    known = product if isinstance(product, Product) else catalogue.MODULES.get(product)
    product_name = product if isinstance(product, str) else product.name
    if chassis:
        category = ProductCategory.C_SERIES_MODULE
    elif re.search(r"-43\d\d", product_name):
        category = ProductCategory.SC_EXPRESS
    else:
        category = ProductCategory.X_SERIES_DAQ if "-63" in product_name else ProductCategory.UNKNOWN
    bus = (
        BusType.COMPACT_DAQ if chassis else BusType.PXIE if product_name.startswith("PXIe") else BusType.PCIE
    )
    return Device(name, product_name, known, serial, number, chassis, slot, bus=bus, category=category)


def channel_list(text: str) -> list[str]:
    """``Dev/ai0:2, Dev/ai7`` → the single names."""
    names: list[str] = unflatten_channel_string(text)
    return [name.strip() for name in names if name.strip()]

"""What hardware the simulated driver finds: chassis, modules, stand-alone devices."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from nidaqmx.constants import BusType, ProductCategory
from nidaqmx.utils import unflatten_channel_string

from daq_app.config.hardware import catalogue
from daq_app.config.hardware.own_products import own_products
from daq_app.config.hardware.product_files import NO_PRODUCTS, ProductSet
from daq_app.config.hardware.products import ChassisProduct, Counters, Product
from daq_app.config.rig import Rig
from sim_hardware.daqmx_server.errors import Code, DaqmxError

_INTERNAL = re.compile(
    r"_ao(\d+)_vs_aognd|_aignd_vs_aignd|_ao\d+_vs_.*|_cal.*|_boardtempsensor_vs_aignd|_cjtemp"
)
_TERMINAL = re.compile(r"^/?(?P<device>[^/]+)/(?P<rest>.+)$")


@dataclass(frozen=True, slots=True)
class Device:
    """One name in NI MAX: a chassis, a module in it, or a stand-alone board.

    `product` is what is simulated of it: of a chassis its counters; None where no product file knows it.
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

    simulated: bool = True
    """What NI MAX says; a device that is not simulated shows what is wired to it, its own outputs first."""

    @property
    def physical_channels(self) -> tuple[str, ...]:
        """Analogue inputs."""
        if self.product is None:
            return ()
        if "power" in self.product.measurements:
            return (f"{self.name}/power",)
        return tuple(f"{self.name}/ai{i}" for i in range(self.product.n_ai))

    @property
    def outputs(self) -> tuple[str, ...]:
        """Analogue outputs."""
        return tuple(f"{self.name}/ao{i}" for i in range(self.product.outputs.n)) if self.product else ()

    @property
    def ports(self) -> tuple[str, ...]:
        """Digital ports."""
        count = len(self.product.ports.lines) if self.product else 0
        return tuple(f"{self.name}/port{i}" for i in range(count))

    @property
    def lines(self) -> tuple[str, ...]:
        """Digital lines of all ports."""
        lines = self.product.ports.lines if self.product else ()
        return tuple(f"{self.name}/port{p}/line{i}" for p, n in enumerate(lines) for i in range(n))

    @property
    def counters(self) -> tuple[str, ...]:
        """Counters; those of a chassis are internal channels (``cDAQ1/_ctr0``)."""
        stem = "_ctr" if self.is_chassis else "ctr"
        return tuple(f"{self.name}/{stem}{i}" for i in range(self.product.counters.n)) if self.product else ()


@dataclass(slots=True)
class Inventory:
    """Devices by name, in the order of NI MAX."""

    devices: dict[str, Device] = field(default_factory=dict)
    accessories: dict[str, list[tuple[int, str]]] = field(default_factory=dict)
    """Device → (connector, product) of the terminal blocks on it."""
    cables: list[frozenset[str]] = field(default_factory=list)
    """Terminals that a cable joins, by their plain names (``cdaq1/pfi0``)."""

    def add(self, device: Device) -> None:
        self.devices[device.name] = device

    @classmethod
    def from_rig(cls, rig: Rig) -> Inventory:
        """Chassis and modules of a rig file. Raises `catalogue.UnknownProduct`.

        A PXI chassis is no device of NI-DAQmx: its cards stand for themselves.
        """
        inventory = cls()
        cable = rig.hardware.clock_cable
        for terminal in () if cable is None else (cable.clock, cable.trigger):
            ends = (f"{entry.name}/{terminal}".lower() for entry in rig.hardware.chassis)
            inventory.cables.append(frozenset(ends))
        own = own_products(rig.hardware)
        for entry in rig.hardware.chassis:
            chassis = catalogue.chassis(entry.product, own.chassis)
            if chassis.bus == "cdaq":
                inventory.add(cdaq_chassis(entry.name, chassis))
            for item in entry.modules:
                product = catalogue.module(item.product, own.products)
                name = item.name or catalogue.device_name(entry.name, chassis.bus, item.slot)
                serial = int(item.serial, 16) if re.fullmatch(r"[0-9A-Fa-f]{1,8}", item.serial) else 0
                owner = entry.name if chassis.bus == "cdaq" else ""
                inventory.add(module_device(name, product, owner, item.slot, serial))
        return inventory

    def without_channels(self) -> list[Device]:
        """Devices whose product no product file knows: they are there, but have no channels."""
        return [
            device for device in self.devices.values() if device.product is None and not device.is_chassis
        ]

    def joined(self, terminal: str) -> frozenset[str]:
        """The plain name of a terminal, and those of the terminals that a cable joins with it."""
        return next((cable for cable in self.cables if terminal in cable), frozenset({terminal}))

    def device(self, name: str) -> Device:
        """Case-insensitive, as in NI-DAQmx; a channel names its device, too. −200220 if there is none."""
        wanted = name.strip().strip("/").partition("/")[0].lower()
        for known, device in self.devices.items():
            if known.lower() == wanted:
                return device
        raise DaqmxError(Code.INVALID_DEVICE, f"Device Specified: {name.strip()}")

    def physical_channel(self, name: str) -> tuple[Device, int]:
        """Device and number of an analogue input such as ``cDAQ1Mod1/ai3``; −200220 or −200170.

        Internal channels (``Dev1/_ao0_vs_aognd``) and multimeters (``myDAQ1/dmm``) have the number −1.
        """
        device, terminal = self.split(name)
        known = {channel.partition("/")[2]: n for n, channel in enumerate(device.physical_channels)}
        if terminal in known:
            return device, known[terminal]
        if device.physical_channels and _INTERNAL.match(terminal):
            return device, -1
        if terminal == "dmm" and device.product is not None and "dmm" in device.product.measurements:
            return device, -1
        raise _no_channel(device, terminal or name)

    def split(self, name: str) -> tuple[Device, str]:
        """Device and the rest of a name, in lower case; −200220."""
        match = _TERMINAL.match(name.strip())
        device = self.device(match["device"] if match else name)
        return device, match["rest"].lower() if match else ""

    def named_channel(self, name: str, io: str) -> tuple[Device, str]:
        """Device and full name of a physical channel of a kind (AI, AO, CI, CO); −200220 or −200170."""
        device, terminal = self.split(name)
        if io == "AI":
            _, number = self.physical_channel(name)
            return device, f"{device.name}/{terminal}" if number < 0 else device.physical_channels[number]
        known = device.outputs if io == "AO" else (*device.counters, f"{device.name}/freqout")
        for channel in known:
            if channel.partition("/")[2] == terminal:
                return device, channel
        raise _no_channel(device, terminal or name)

    def digital_lines(self, name: str) -> tuple[Device, list[str]]:
        """Device and lines of ``Dev1/port0``, ``Dev1/port0/line3`` or ``Dev1/line3``."""
        device, terminal = self.split(name)
        if terminal.startswith("line") and device.ports:
            terminal = f"port0/{terminal}"
        lines = [f"{device.name}/{terminal}"] if f"{device.name}/{terminal}" in device.lines else []
        if f"{device.name}/{terminal}" in device.ports:
            lines = [line for line in device.lines if line.startswith(f"{device.name}/{terminal}/")]
        if not lines:
            raise _no_channel(device, terminal or name)
        return device, lines

    def lines_at(self, terminal: str) -> list[str]:
        """The line of that name, in its own spelling; none where the terminal is no line."""
        wanted = terminal.lower().strip("/")
        return [line for device in self.devices.values() for line in device.lines if line.lower() == wanted]

    def host_of(self, device: Device) -> str:
        """The device that owns clocks and triggers: the chassis of a module, else the device itself."""
        return device.chassis or device.name


def _no_channel(device: Device, terminal: str) -> DaqmxError:
    return DaqmxError(
        Code.PHYSICAL_CHANNEL_UNKNOWN,
        f"Device Specified: {device.name}",
        f"Physical Channel Name: {terminal}",
    )


_CHASSIS_COUNTERS = Counters(4, 32, 80e6)
"""NI CompactDAQ user manual: four counters of 32 bits in a chassis, with a timebase of 80 MHz."""


def _counters_of_chassis(product_name: str) -> Product:
    return Product(
        product_name,
        bus="cdaq",
        task_family="counters",
        n_ai=0,
        converter="simultaneous",
        bits=_CHASSIS_COUNTERS.bits,
        terminals={},
        ranges_v=(),
        max_rate_hz=0.0,
        timebase_hz=_CHASSIS_COUNTERS.max_rate_hz,
        counters=_CHASSIS_COUNTERS,
    )


def cdaq_chassis(name: str, product: ChassisProduct | str, serial: int = 0, number: int = 0) -> Device:
    """The device of a cDAQ chassis; one that the catalogue lacks has three timing engines."""
    known = product if isinstance(product, ChassisProduct) else known_chassis(product)
    product_name = product if isinstance(product, str) else product.name
    ethernet = re.search(r"918[1-9]|9191", product_name) is not None
    test_scale = known is not None and known.bus == "testscale"
    return Device(
        name,
        product_name,
        None if test_scale else _counters_of_chassis(product_name),
        serial=serial,
        product_number=number,
        is_chassis=True,
        bus=BusType.TCPIP if ethernet else BusType.USB,
        category=ProductCategory.TEST_SCALE_CHASSIS if test_scale else ProductCategory.COMPACT_DAQ_CHASSIS,
        networked=known is not None and known.network_synchronised,
        timing_engines=known.ai_timing_engines if known else 3,
    )


def known_chassis(name: str, own: ProductSet = NO_PRODUCTS) -> ChassisProduct | None:
    """The chassis of that name, first among the user's own; None if no product file has it."""
    return catalogue.find(name, own.chassis, catalogue.BUILT_IN.chassis)


def known_product(name: str, own: ProductSet = NO_PRODUCTS) -> Product | None:
    """The product of that name, first among the user's own; None if no product file has it."""
    return catalogue.find(name, own.products, catalogue.BUILT_IN.products)


def device_from_text(text: str, inventory: Inventory, own: ProductSet = NO_PRODUCTS) -> Device:
    """``Dev1=PCIe-6363``; ``cDAQ1Mod3=NI 9205`` sits in slot 3 of the chassis cDAQ1 of the inventory.

    Raises `UnknownProduct` or `ValueError`.
    """
    name, equals, product_name = (part.strip() for part in text.partition("="))
    if not (equals and re.fullmatch(r"[A-Za-z][\w-]*", name) and product_name):
        raise ValueError(f"--device {text}: write NAME=PRODUCT, for instance Dev1=PCIe-6363")
    chassis_product = known_chassis(product_name, own)
    if chassis_product is not None:
        return cdaq_chassis(name, chassis_product)
    product = known_product(product_name, own)
    if product is None:
        catalogue.module(product_name, own.products)  # raises, with the names most like it
    place = re.fullmatch(r"(.+)Mod(\d+)", name)
    chassis = place[1] if place and place[1] in inventory.devices else ""
    slot = int(place[2]) if place and chassis else 0
    return module_device(name, product or product_name, chassis, slot)


_BUSES = {
    "cdaq": BusType.COMPACT_DAQ,
    "testscale": BusType.COMPACT_DAQ,
    "pxie": BusType.PXIE,
    "pxi": BusType.PXI,
    "pcie": BusType.PCIE,
    "pci": BusType.PCI,
    "usb": BusType.USB,
}


def module_device(
    name: str, product: Product | str, chassis: str, slot: int, serial: int = 0, number: int = 0
) -> Device:
    """The device of a module or of a card; one that no product file knows has no channels."""
    known = product if isinstance(product, Product) else known_product(product)
    product_name = product if isinstance(product, str) else product.name
    if chassis:
        bus = BusType.COMPACT_DAQ
    else:
        prefix = product_name.partition("-")[0].lower()
        bus = _BUSES.get(known.bus if known else prefix, BusType.PCIE)
    category = ProductCategory.C_SERIES_MODULE if chassis else ProductCategory.UNKNOWN
    if known is not None and known.category:
        category = ProductCategory[known.category]
    return Device(name, product_name, known, serial, number, chassis, slot, bus=bus, category=category)


def channel_list(text: str) -> list[str]:
    """``Dev/ai0:2, Dev/ai7`` → the single names."""
    names: list[str] = unflatten_channel_string(text)
    return [name.strip() for name in names if name.strip()]

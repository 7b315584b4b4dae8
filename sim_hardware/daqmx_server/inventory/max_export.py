"""The inventory of a configuration that NI MAX has exported: devices, scales, channels and tasks."""

from __future__ import annotations

import configparser
from dataclasses import dataclass, field, replace
from pathlib import Path

from daq_app.config.errors import ConfigError, Problem
from daq_app.config.hardware.max_file import (
    CHASSIS_KIND,
    MODULE_KIND,
    ListedDevice,
    devices_in,
    read_max_file,
)
from daq_app.config.hardware.product_files import NO_PRODUCTS, ProductSet
from sim_hardware.daqmx_server.inventory.devices import (
    Device,
    Inventory,
    cdaq_chassis,
    known_chassis,
    known_product,
    module_device,
)


@dataclass(slots=True)
class MaxExport:
    """An export's devices, and what was saved in NI MAX: name → the keys of its section."""

    inventory: Inventory = field(default_factory=Inventory)
    scales: dict[str, dict[str, str]] = field(default_factory=dict)
    channels: dict[str, dict[str, str]] = field(default_factory=dict)
    """Global channels by name, channels of saved tasks as ``task/channel``."""
    tasks: dict[str, dict[str, str]] = field(default_factory=dict)


def load_max_export(*paths: Path, own: ProductSet = NO_PRODUCTS) -> MaxExport:
    """Devices, scales, channels and tasks of one or more exports, in their order.

    `own` are products that the catalogue lacks. Raises `ConfigError` for a file that is no such export.
    """
    export = MaxExport()
    for path in paths:
        parser = read_max_file(path)
        for kind, listed in devices_in(path, parser):
            export.inventory.add(_device(kind, listed, own))
        for section in parser.sections():
            _take(export, section, parser[section])
    if not export.inventory.devices:
        right = "Export it again from NI MAX as an .ini file"
        raise ConfigError([Problem(str(paths[0]), "", "there is no device in it", right)])
    return export


def _take(export: MaxExport, section: str, keys: configparser.SectionProxy) -> None:
    kind, _, name = section.partition(" ")
    saved = {"DAQmxScale": export.scales, "DAQmxChannel": export.channels, "DAQmxTask": export.tasks}
    if kind in saved and name:
        saved[kind][name] = {key: (value or "").strip().strip('"') for key, value in keys.items()}
    elif kind == "DAQmxAccessory":
        product, device, slot = [*name.split("/"), "", ""][:3]
        export.inventory.accessories.setdefault(device, []).append((int(slot or 0), product))


def _device(kind: str, listed: ListedDevice, own: ProductSet) -> Device:
    serial, number = int(listed.serial or "0", 16), listed.product_number
    if kind == CHASSIS_KIND:
        product = known_chassis(listed.product, own) or listed.product
        return replace(cdaq_chassis(listed.name, product, serial, number), simulated=listed.simulated)
    chassis = listed.chassis if kind == MODULE_KIND else ""
    module = known_product(listed.product, own) or listed.product
    device = module_device(listed.name, module, chassis, listed.slot, serial, number)
    return replace(device, simulated=listed.simulated)

"""The inventory of a configuration that NI MAX has exported (File → Export, format ``.ini``)."""

from __future__ import annotations

import configparser
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from daq_app.config.errors import ConfigError, Problem
from daq_app.config.hardware.product_files import NO_PRODUCTS, ProductSet
from sim_hardware.daqmx_server.inventory.devices import (
    Device,
    Inventory,
    cdaq_chassis,
    known_chassis,
    known_product,
    module_device,
)

_ENCODINGS: Final = ("utf-8-sig", "utf-16", "cp1252")
_MAX_BYTES: Final = 16 * 1024 * 1024


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
        parser = configparser.ConfigParser(interpolation=None, strict=False, default_section="\0")
        parser.optionxform = str  # type: ignore[assignment,method-assign]  # MAX writes keys in mixed case
        try:
            parser.read_string(_text(path))
        except (OSError, ValueError, configparser.Error) as error:
            raise _problem(path, "", f"the export cannot be read ({error})") from error
        for section in parser.sections():
            _take(export, path, section, parser[section], own)
        if not any(section.startswith("DAQmx") for section in parser.sections()):
            raise _problem(path, "", "there is no device in it")
    if not export.inventory.devices:
        raise _problem(paths[0], "", "there is no device in it")
    return export


def _take(
    export: MaxExport, path: Path, section: str, keys: configparser.SectionProxy, own: ProductSet
) -> None:
    kind, _, name = section.partition(" ")
    saved = {"DAQmxScale": export.scales, "DAQmxChannel": export.channels, "DAQmxTask": export.tasks}
    if kind in saved and name:
        saved[kind][name] = {key: (value or "").strip().strip('"') for key, value in keys.items()}
    elif kind in ("DAQmxDevice", "DAQmxCDAQChassis", "DAQmxCDAQModule") and name:
        export.inventory.add(_device(path, section, kind, name, keys, own))
    elif kind == "DAQmxAccessory":
        product, device, slot = [*name.split("/"), "", ""][:3]
        export.inventory.accessories.setdefault(device, []).append((int(slot or 0), product))


def _device(
    path: Path, section: str, kind: str, name: str, keys: configparser.SectionProxy, own: ProductSet
) -> Device:
    product = keys.get("ProductType", "").strip()
    if not product:
        raise _problem(path, section, "ProductType is missing")
    try:
        serial, number = (int(keys.get(key, "0"), 0) for key in ("DevSerialNum", "ProductNum"))
        simulated = int(keys.get("DevIsSimulated", "1"), 0) != 0
        slot = int(keys.get("CompactDAQ.SlotNum") or keys.get("PXI.SlotNum") or 0)
    except ValueError as error:
        raise _problem(path, section, str(error)) from error
    if kind == "DAQmxCDAQChassis":
        return replace(
            cdaq_chassis(name, known_chassis(product, own) or product, serial, number), simulated=simulated
        )
    chassis = keys.get("CompactDAQ.ChassisDevName", "").strip() if kind == "DAQmxCDAQModule" else ""
    device = module_device(name, known_product(product, own) or product, chassis, slot, serial, number)
    return replace(device, simulated=simulated)


def _text(path: Path) -> str:
    raw = path.read_bytes()
    if len(raw) > _MAX_BYTES:
        raise ValueError("it is larger than any export")
    for encoding in _ENCODINGS:
        try:
            return raw.decode(encoding)
        except UnicodeError:
            continue
    raise ValueError("its encoding is unknown")


def _problem(path: Path, key: str, wrong: str) -> ConfigError:
    return ConfigError([Problem(str(path), key, wrong, "Export it again from NI MAX as an .ini file")])

"""The inventory of a configuration that NI MAX has exported (File → Export, format ``.ini``)."""

from __future__ import annotations

import configparser
from pathlib import Path
from typing import Final

from daq_app.config.errors import ConfigError, Problem
from sim_hardware.daqmx_server.inventory.devices import Device, Inventory, cdaq_chassis, module_device

_ENCODINGS: Final = ("utf-8-sig", "utf-16", "cp1252")
_MAX_BYTES: Final = 16 * 1024 * 1024


def load_max_export(path: Path) -> Inventory:
    """Chassis, modules and boards of the export, in its order; its tasks and scales are not taken over.

    Raises `ConfigError` for a file that is no such export.
    """
    parser = configparser.ConfigParser(interpolation=None, strict=False, default_section="\0")
    parser.optionxform = str  # type: ignore[assignment,method-assign]  # MAX writes keys in mixed case
    try:
        parser.read_string(_text(path))
    except (OSError, ValueError, configparser.Error) as error:
        raise _problem(path, "", f"the export cannot be read ({error})") from error
    inventory = Inventory()
    for section in parser.sections():
        kind, _, name = section.partition(" ")
        if kind in ("DAQmxDevice", "DAQmxCDAQChassis", "DAQmxCDAQModule") and name:
            inventory.add(_device(path, section, kind, name, parser[section]))
    if not inventory.devices:
        raise _problem(path, "", "there is no device in it")
    return inventory


def _device(path: Path, section: str, kind: str, name: str, keys: configparser.SectionProxy) -> Device:
    product = keys.get("ProductType", "").strip()
    if not product:
        raise _problem(path, section, "ProductType is missing")
    try:
        serial, number = (int(keys.get(key, "0"), 0) for key in ("DevSerialNum", "ProductNum"))
        slot = int(keys.get("CompactDAQ.SlotNum") or keys.get("PXI.SlotNum") or 0)
    except ValueError as error:
        raise _problem(path, section, str(error)) from error
    if kind == "DAQmxCDAQChassis":
        return cdaq_chassis(name, product, serial, number)
    chassis = keys.get("CompactDAQ.ChassisDevName", "").strip() if kind == "DAQmxCDAQModule" else ""
    return module_device(name, product, chassis, slot, serial, number)


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

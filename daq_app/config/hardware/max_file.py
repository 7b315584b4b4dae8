"""The devices of a configuration that NI MAX has exported (File → Export, format ``.ini``)."""

from __future__ import annotations

import configparser
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daq_app.config.errors import ConfigError, Problem

_ENCODINGS: Final = ("utf-8-sig", "utf-16", "cp1252")
_MAX_BYTES: Final = 16 * 1024 * 1024
_NONE: Final = 0xFFFFFFFF
"""What an export writes for a slot or chassis that NI MAX does not know."""
CHASSIS_KIND: Final = "DAQmxCDAQChassis"
MODULE_KIND: Final = "DAQmxCDAQModule"
DEVICE_KINDS: Final = ("DAQmxDevice", CHASSIS_KIND, MODULE_KIND)
"""Kinds of sections that describe a device."""


@dataclass(frozen=True, slots=True)
class ListedDevice:
    """A device as NI MAX or NI-DAQmx lists it."""

    name: str
    product: str
    serial: str = ""
    """Eight hexadecimal digits; empty where there is none (simulated devices)."""
    chassis: str = ""
    """Name of the cDAQ chassis a module sits in; ``PXI1`` for a card of the first PXI chassis."""
    slot: int = 0
    is_chassis: bool = False
    simulated: bool = False
    product_number: int = 0


def read_max_file(path: Path) -> configparser.ConfigParser:
    """The sections of an export. Raises `ConfigError` for a file that is none."""
    parser = configparser.ConfigParser(interpolation=None, strict=False, default_section="\0")
    parser.optionxform = str  # type: ignore[assignment,method-assign]  # MAX writes keys in mixed case
    try:
        parser.read_string(_text(path))
    except (OSError, ValueError, configparser.Error) as error:
        raise _problem(path, "", f"the export cannot be read ({error})") from error
    if not any(section.startswith("DAQmx") for section in parser.sections()):
        raise _problem(path, "", "there is no device in it")
    return parser


def devices_in(path: Path, parser: configparser.ConfigParser) -> Iterator[tuple[str, ListedDevice]]:
    """(kind of section, device) of every device of an export, in its order. Raises `ConfigError`."""
    for section in parser.sections():
        kind, _, name = section.partition(" ")
        if kind in DEVICE_KINDS and name:
            yield kind, _device(path, section, kind, name, parser[section])


def listed_in_export(path: Path) -> list[ListedDevice]:
    """The devices of an export. Raises `ConfigError`."""
    devices = [device for _, device in devices_in(path, read_max_file(path))]
    if not devices:
        raise _problem(path, "", "there is no device in it")
    return devices


def _device(path: Path, section: str, kind: str, name: str, keys: configparser.SectionProxy) -> ListedDevice:
    product = keys.get("ProductType", "").strip()
    if not product:
        raise _problem(path, section, "ProductType is missing")
    try:
        serial, number = (int(keys.get(key, "0"), 0) for key in ("DevSerialNum", "ProductNum"))
        simulated = int(keys.get("DevIsSimulated", "1"), 0) != 0
        slot = int(keys.get("CompactDAQ.SlotNum") or keys.get("PXI.SlotNum") or 0)
        pxi = int(keys.get("PXI.ChassisNum") or _NONE)
    except ValueError as error:
        raise _problem(path, section, str(error)) from error
    chassis = keys.get("CompactDAQ.ChassisDevName", "").strip() if kind == MODULE_KIND else ""
    return ListedDevice(
        name,
        product,
        f"{serial:08X}" if serial else "",
        chassis or (f"PXI{pxi}" if pxi != _NONE else ""),
        0 if slot == _NONE else slot,
        kind == CHASSIS_KIND,
        simulated,
        number,
    )


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

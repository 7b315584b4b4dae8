"""The hardware part of a rig file, from the devices that are there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import tomli_w

from daq_app.config.errors import ConfigError, Problem
from daq_app.config.hardware import catalogue
from daq_app.config.hardware.max_file import ListedDevice

PXI_UNNAMED: Final = "the product of the PXI chassis"
"""Stands for what no list of devices tells."""
_HEAD: Final = "# The hardware of {source}: put it in the place of [hardware] in a rig file.\n"


def hardware_text(devices: Sequence[ListedDevice], source: str, connection: str = "local") -> str:
    """TOML of ``[hardware]``: every chassis with its modules, by name and slot.

    Modules that the catalogue lacks and cards outside a chassis stand as comments, and so does the product
    of a PXI chassis, which no list of devices tells. Raises `ConfigError` where there is no module in one.
    """
    tables, remarks = chassis_tables(devices, source)
    text = tomli_w.dumps({"hardware": {"connection": connection, "chassis": tables}})
    return _HEAD.format(source=source) + "".join(f"# {remark}.\n" for remark in remarks) + text


def chassis_tables(devices: Sequence[ListedDevice], source: str) -> tuple[list[dict[str, Any]], list[str]]:
    """(every chassis with its modules as a rig file has them, what no list tells or the catalogue lacks).

    Raises `ConfigError` where there is no module in a chassis.
    """
    modules = [device for device in devices if device.chassis and device.slot]
    owners = list(dict.fromkeys(device.chassis for device in modules))
    if not owners:
        right = "A rig file needs a chassis with modules: cDAQ, or PXI cards"
        raise ConfigError([Problem(source, "", "no module sits in a chassis", right)])
    products = {device.name: device.product for device in devices if device.is_chassis}
    remarks: list[str] = []
    tables: list[dict[str, Any]] = []
    for owner in owners:
        mine = sorted((d for d in modules if d.chassis == owner), key=lambda device: device.slot)
        tables.append(_chassis(owner, products.get(owner, PXI_UNNAMED), mine, remarks))
        if owner not in products:
            remarks.append(f"{owner}: NI-DAQmx does not name the product of a PXI chassis; write it")
    remarks += [
        f"{device.name} ({device.product}) is left out: no chassis and slot are listed for it"
        for device in devices
        if not device.is_chassis and not (device.chassis and device.slot)
    ]
    return tables, remarks


def _chassis(name: str, product: str, modules: Sequence[ListedDevice], remarks: list[str]) -> dict[str, Any]:
    bus = "pxie" if product == PXI_UNNAMED else "cdaq"
    entries: list[dict[str, Any]] = []
    for device in modules:
        known = catalogue.find(device.product, catalogue.MODULES, catalogue.BUILT_IN.products)
        if known is None:
            place = f"{device.name} in slot {device.slot} of {name}"
            remarks.append(
                f"{place} is a {device.product}, which the catalogue lacks: "
                f"`daq-app rig product {device.name}` describes it"
            )
            continue
        entry: dict[str, Any] = {"slot": device.slot, "product": known.name}
        if device.name != catalogue.device_name(name, bus, device.slot):
            entry["name"] = device.name
        if device.serial:
            entry["serial"] = device.serial
        entries.append(entry)
    return {"name": name, "product": product, "modules": entries}

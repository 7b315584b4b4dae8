"""A rig's hardware section against the devices that are really there."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Protocol

from daq_app.config.hardware import catalogue
from daq_app.config.hardware.max_file import ListedDevice
from daq_app.config.hardware.own_products import own_products
from daq_app.config.rig import Hardware, Module


class Present(Protocol):
    """A device that is there."""

    @property
    def name(self) -> str: ...

    @property
    def product(self) -> str: ...

    @property
    def serial(self) -> str: ...


def wrong_module(name: str, wanted: Module, there: Present) -> str:
    """What is wrong with the module that sits where the rig file has another; empty if nothing is."""
    if not same_product(there.product, wanted.product):
        return (
            f"{name} is a {there.product} where the rig file has {wanted.product}: put the right "
            f"module into slot {wanted.slot}, or correct the rig file"
        )
    if wanted.serial and there.serial and wanted.serial.lstrip("0") != there.serial.lstrip("0"):
        return (
            f"{name} has serial number {there.serial} where the rig file has {wanted.serial}: "
            "was the module exchanged?"
        )
    return ""


def differences(hardware: Hardware, listed: Iterable[ListedDevice]) -> list[str]:
    """One sentence for each way in which a list of devices is not the hardware of a rig file.

    Chassis that the rig file does not name are of no interest to it.
    """
    there = {device.name: device for device in listed}
    wrong: list[str] = []
    named: set[str] = set()
    owners: set[str] = set()
    own = own_products(hardware)
    for entry in hardware.chassis:
        chassis = catalogue.find(entry.product, own.chassis, catalogue.CHASSIS)
        on_backplane = chassis is not None and chassis.bus == "pxie"
        owners.add(entry.name)
        if not on_backplane:
            wrong += _wrong_chassis(entry.name, entry.product, there)
        for module in entry.modules:
            name = module.name or catalogue.device_name(
                entry.name, "pxie" if on_backplane else "cdaq", module.slot
            )
            named.add(name)
            device = there.get(name)
            if device is None:
                wrong.append(f"{name} ({module.product}) is missing")
            elif device.slot and device.slot != module.slot:
                wrong.append(f"{name} sits in slot {device.slot} where the rig file has slot {module.slot}")
            elif sentence := wrong_module(name, module, device):
                wrong.append(sentence)
    wrong += [
        f"{device.name} ({device.product}, slot {device.slot} of {device.chassis}) is not in the rig file"
        for device in there.values()
        if device.chassis in owners and device.name not in named
    ]
    return wrong


def _wrong_chassis(name: str, product: str, there: dict[str, ListedDevice]) -> list[str]:
    device = there.get(name)
    if device is None:
        return [f"the chassis {name} ({product}) is missing"]
    if not same_product(device.product, product):
        return [f"the chassis {name} is a {device.product} where the rig file has {product}"]
    return []


def same_product(one: str, other: str) -> bool:
    """``NI 9205`` and ``NI-9205 (DSUB)`` are the same for us."""
    return _plain(one) == _plain(other)


def _plain(name: str) -> str:
    return re.sub(r"[\s-]|\(.*\)", "", name).upper()

"""Which devices a rig's hardware section describes, by the names that NI-DAQmx knows them by."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from daq_app.config.errors import Problem
from daq_app.config.hardware import catalogue
from daq_app.config.hardware.own_products import own_products
from daq_app.config.hardware.products import ChassisProduct, Product
from daq_app.config.rig import Chassis, Hardware, Module

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")


@dataclass(frozen=True, slots=True)
class Device:
    """One module in its chassis."""

    name: str
    product: Product
    chassis_name: str
    chassis: ChassisProduct
    slot: int
    key: str
    """Key path of the module in the rig file."""


def devices_of(hardware: Hardware, file: str = "") -> tuple[dict[str, Device | None], list[Problem]]:
    """Device name → device, and the problems; None is a module whose product is not known."""
    problems: list[Problem] = []
    devices: dict[str, Device | None] = {}
    own = own_products(hardware)
    chassis_keys: dict[str, str] = {}
    for index, entry in enumerate(hardware.chassis):
        key = f"hardware.chassis[{index}] ({entry.name})"
        problems += _name_problems(entry.name, f"{key}.name", file)
        earlier = chassis_keys.setdefault(entry.name, key)
        if earlier != key:
            wrong = f"two chassis are called `{entry.name}` (the other is {earlier})"
            problems.append(
                Problem(file, f"{key}.name", wrong, "Give each chassis its own name, as in NI MAX")
            )
        try:
            product = catalogue.chassis(entry.product, own.chassis)
        except catalogue.UnknownProduct as error:
            problems.append(_unknown(error, f"{key}.product", "chassis", file))
            product = None
        for name, where, device in _modules(entry, product, own.products, key, file, problems):
            if name in devices:
                wrong = f"two modules have the device name `{name}`"
                right = "Give each module its own slot and name, as in NI MAX"
                problems.append(Problem(file, f"{where}.name", wrong, right))
            else:
                devices[name] = device
    return devices, problems


def _modules(
    entry: Chassis,
    chassis: ChassisProduct | None,
    own: Mapping[str, Product],
    key: str,
    file: str,
    problems: list[Problem],
) -> list[tuple[str, str, Device | None]]:
    """(device name, key path, device) of each module; None where its product is not known."""
    slots: dict[int, str] = {}
    devices: list[tuple[str, str, Device | None]] = []
    bus = chassis.bus if chassis else "pxie" if entry.product.upper().startswith("PXI") else "cdaq"
    for index, item in enumerate(entry.modules):
        where = f"{key}.modules[{index}]"
        earlier = slots.setdefault(item.slot, where)
        if earlier != where:
            wrong = f"slot {item.slot} holds two modules (the other is {earlier})"
            problems.append(Problem(file, f"{where}.slot", wrong, "Give each module the slot it sits in"))
        name = item.name or catalogue.device_name(entry.name, bus, item.slot)
        if item.name:
            problems += _name_problems(item.name, f"{where}.name", file)
        try:
            product = catalogue.module(item.product, own)
        except catalogue.UnknownProduct as error:
            problems.append(_unknown(error, f"{where}.product", "modules", file))
            devices.append((name, where, None))
            continue
        if chassis is None:
            # The chassis is unknown and reported; its modules still let the channels be checked.
            chassis = ChassisProduct(entry.product, product.bus, tuple(range(1, 19)), None, 0.0)
        problems += _fit_problems(item, product, chassis, where, file)
        devices.append((name, where, Device(name, product, entry.name, chassis, item.slot, where)))
    return devices


def _fit_problems(
    item: Module, product: Product, chassis: ChassisProduct, where: str, file: str
) -> list[Problem]:
    problems = []
    if product.bus != chassis.bus:
        wrong = f"{product.name} does not fit into a {chassis.name}"
        right = "C Series modules (NI 9xxx) go into cDAQ chassis, PXIe cards into PXIe chassis"
        problems.append(Problem(file, f"{where}.product", wrong, right))
    elif item.slot not in chassis.slots:
        wrong = f"{chassis.name} has no module slot {item.slot}"
        extra = "; slot 1 is the controller's" if chassis.bus == "pxie" else ""
        right = f"Slots for modules are {chassis.slots[0]} to {chassis.slots[-1]}{extra}"
        problems.append(Problem(file, f"{where}.slot", wrong, right))
    return problems


def _name_problems(name: str, key: str, file: str) -> list[Problem]:
    if _NAME.fullmatch(name):
        return []
    wrong = f"`{name}` is no device name"
    return [Problem(file, key, wrong, "Use letters, digits, - and _, a letter first, as NI MAX shows it")]


def _unknown(error: catalogue.UnknownProduct, key: str, what: str, file: str) -> Problem:
    known = sorted(catalogue.CHASSIS if what == "chassis" else catalogue.MODULES)
    hint = f"Did you mean {' or '.join(error.near)}? " if error.near else ""
    wrong = f"`{error.name}` is not in the hardware catalogue"
    own = "Describe others in a product file beside the rig file and name it in hardware.products"
    return Problem(file, key, wrong, f"{hint}Known {what}: {', '.join(known)}. {own}")

"""The devices of a new rig and their free inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from daq_app.config.errors import ConfigError, Problem
from daq_app.config.hardware import catalogue
from daq_app.config.hardware.inventory import Device, devices_of
from daq_app.config.hardware.products import Product
from daq_app.config.rig import Hardware

CHASSIS = "cDAQ-9178"


def chassis_name(chassis: str) -> str:
    """The name that NI-DAQmx gives the first chassis of that kind."""
    return "PXI1" if catalogue.chassis(chassis).bus == "pxie" else "cDAQ1"


def chassis_table(chassis: str, modules: Sequence[str], file: str) -> dict[str, Any]:
    """One chassis with its modules slot by slot, as a rig file has it. Raises `ConfigError`."""
    try:
        first = 2 if catalogue.chassis(chassis).bus == "pxie" else 1
        products = [catalogue.module(name).name for name in modules]
    except catalogue.UnknownProduct as error:
        hint = f"Did you mean {error.near[0]}?" if error.near else "See NI's product name in NI MAX"
        raise ConfigError([Problem(file, "hardware", str(error), hint)]) from None
    slots = [{"slot": slot, "product": name} for slot, name in enumerate(products, start=first)]
    return {"name": chassis_name(chassis), "product": catalogue.chassis(chassis).name, "modules": slots}


def devices_in(chassis: Sequence[Mapping[str, Any]], file: str) -> list[Device]:
    """The modules of those chassis, in their order. Raises `ConfigError` for what cannot be."""
    devices, problems = devices_of(Hardware.model_validate({"chassis": list(chassis)}), file)
    if problems:
        raise ConfigError(problems)
    return [device for device in devices.values() if device is not None]


def terminal_config(product: Product) -> str:
    """DIFF where the module has it."""
    return "DIFF" if "DIFF" in product.terminals else next(iter(product.terminals), "DIFF")


def inputs(product: Product) -> list[int]:
    """The ai numbers that a module has in its `terminal_config`."""
    return sorted(product.terminals.get(terminal_config(product), frozenset()))  # type: ignore[call-overload]

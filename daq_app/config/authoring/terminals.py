"""Which module and input each sensor of a new rig gets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from daq_app.config.authoring.sensor import Sensor
from daq_app.config.errors import ConfigError, Problem
from daq_app.config.hardware import catalogue
from daq_app.config.hardware.products import Product

CHASSIS = "cDAQ-9178"
MODULE = "NI 9205"


def modules_for(sensors: Sequence[Sensor]) -> list[str]:
    """As many NI 9205 as the sensors need, where the owner names no modules."""
    inputs = len(_inputs(catalogue.module(MODULE)))
    return [MODULE] * max(1, -(-len(sensors) // inputs))


def wire_up(sensors: Sequence[Sensor], chassis: str, modules: Sequence[str], file: str) -> list[Sensor]:
    """The sensors with a terminal each; those that name one keep it.

    Raises `ConfigError` for a product that is not known and for more sensors than inputs.
    """
    try:
        bus = catalogue.chassis(chassis).bus
        products = [catalogue.module(name) for name in modules]
    except catalogue.UnknownProduct as error:
        hint = f"Did you mean {error.near[0]}?" if error.near else "See NI's product name in NI MAX"
        raise ConfigError([Problem(file, "hardware", str(error), hint)]) from None
    taken = {sensor.physical_channel for sensor in sensors}
    free = (name for name in _names(bus, products) if name not in taken)
    wired = []
    for sensor in sensors:
        name = sensor.physical_channel or next(free, "")
        if not name:
            total = sum(len(_inputs(product)) for product in products)
            wrong = f"{len(sensors)} sensors need more than the {total} inputs of {', '.join(modules)}"
            raise ConfigError([Problem(file, "hardware", wrong, "Name another module with --module")])
        wired.append(replace(sensor, physical_channel=name))
    return wired


def chassis_name(chassis: str) -> str:
    """The name that NI-DAQmx gives the first chassis of that kind."""
    return "PXI1" if catalogue.chassis(chassis).bus == "pxie" else "cDAQ1"


def terminal_config(module: str) -> str:
    """DIFF where the module has it."""
    return next(iter(catalogue.module(module).terminals)) if _has_no_diff(module) else "DIFF"


def _has_no_diff(module: str) -> bool:
    return "DIFF" not in catalogue.module(module).terminals


def _inputs(product: Product) -> list[int]:
    config = "DIFF" if "DIFF" in product.terminals else next(iter(product.terminals), None)
    return sorted(product.terminals[config]) if config else []


def _names(bus: str, products: Sequence[Product]) -> Iterator[str]:
    first_slot = 2 if bus == "pxie" else 1
    name = "PXI1" if bus == "pxie" else "cDAQ1"
    for slot, product in enumerate(products, start=first_slot):
        device = catalogue.device_name(name, bus, slot)
        yield from (f"{device}/ai{number}" for number in _inputs(product))

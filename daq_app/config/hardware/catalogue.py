"""The hardware catalogue: look products up, and what NI-DAQmx makes of a request.

The planner predicts with these functions and the simulated device server behaves by them, so both
say the same.  Rates in Hz, times in seconds, ranges in volts.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final, TypeVar

from daq_app.config.hardware.product_files import ProductSet, built_in
from daq_app.config.hardware.products import ChassisProduct, DeltaSigma, Product, Range
from daq_app.config.validation import nearest

PADDING_S = 10e-6
"""Settling time that NI-DAQmx adds between two conversions where there is room (NI cDAQ manuals)."""
_DEFAULT_TIMEBASE_HZ = 80e6
PLANNED: Final = frozenset({"voltage", "iepe", "lvdt_native", "current", "bridge", "thermocouple"})
"""Measurements that a rig file can ask for."""
_NONE: Final[Mapping[str, Any]] = MappingProxyType({})


class UnknownProduct(LookupError):
    """A product that the catalogue does not have; `near` are the names most like it."""

    def __init__(self, name: str, near: Sequence[str]) -> None:
        self.name = name
        self.near = tuple(near)
        super().__init__(f"{name!r} is not in the hardware catalogue")


BUILT_IN: Final[ProductSet] = built_in()
MODULES: Final[Mapping[str, Product]] = MappingProxyType(
    {
        name: item
        for name, item in BUILT_IN.products.items()
        if item.n_ai and item.bus in ("cdaq", "pxie") and item.measurements & PLANNED
    }
)
"""Product name → module that the planner can put channels on."""
CHASSIS: Final[Mapping[str, ChassisProduct]] = MappingProxyType(
    {name: item for name, item in BUILT_IN.chassis.items() if item.bus in ("cdaq", "pxie")}
)
"""Product name → chassis."""
_Entry = TypeVar("_Entry")


def find(name: str, *tables: Mapping[str, _Entry]) -> _Entry | None:
    """The entry of that name in the first table that has it; ``ni-9205 (DSUB)`` is ``NI 9205``."""
    for table in tables:
        if name in table:
            return table[name]
    wanted = _spelling(name)
    return next(
        (entry for table in tables for known, entry in table.items() if _spelling(known) == wanted), None
    )


def _spelling(name: str) -> str:
    return re.sub(r"\(.*\)", "", name).casefold().replace("-", " ").replace("_", " ").strip()


def module(name: str, own: Mapping[str, Product] = _NONE) -> Product:
    """The module of that product name, first among the user's own. Raises `UnknownProduct`."""
    found = find(name, own, MODULES, BUILT_IN.products)
    if found is None:
        raise UnknownProduct(name, nearest(name, [*own, *MODULES], n=3))
    return found


def chassis(name: str, own: Mapping[str, ChassisProduct] = _NONE) -> ChassisProduct:
    """The chassis of that product name, first among the user's own. Raises `UnknownProduct`."""
    found = find(name, own, CHASSIS, BUILT_IN.chassis)
    if found is None:
        raise UnknownProduct(name, nearest(name, [*own, *CHASSIS], n=3))
    return found


def device_name(chassis_name: str, bus: str, slot: int) -> str:
    """The name NI-DAQmx gives a module: ``cDAQ1Mod3`` or ``PXI1Slot4``."""
    return f"{chassis_name}{'Slot' if bus == 'pxie' else 'Mod'}{slot}"


def coerce_rate(products: Sequence[str | Product], requested_hz: float) -> float:
    """The sample rate that a task over these modules runs at when `requested_hz` is asked.

    Always coerced up.  Delta-sigma C Series modules share the fastest of their timebases and clock
    the whole task; otherwise the timebase of the card or chassis is divided.  Slow modules follow
    (repeating points).  Raises `ValueError` where no module set can go as fast as asked.
    """
    if not (math.isfinite(requested_hz) and requested_hz > 0):
        raise ValueError(f"a sample rate of {requested_hz} Hz is no rate")
    modules = [module(item) if isinstance(item, str) else item for item in products]
    clocks = [item.delta_sigma for item in modules if item.delta_sigma]
    fastest = min((item.max_rate_hz for item in modules if item.converter != "slow"), default=math.inf)
    if clocks:
        return _delta_sigma_rate(clocks, requested_hz)
    if requested_hz > fastest * (1 + 1e-9):
        raise ValueError(f"these modules reach {fastest:g} Hz at most, not {requested_hz:g} Hz")
    if any(item.converter == "delta_sigma" for item in modules):
        return float(requested_hz)  # direct digital synthesis: any rate (SC Express)
    timebase = max((item.timebase_hz for item in modules), default=0.0) or _DEFAULT_TIMEBASE_HZ
    return timebase / max(1, math.floor(timebase / requested_hz * (1 + 1e-12)))


def _delta_sigma_rate(clocks: Sequence[DeltaSigma], requested_hz: float) -> float:
    timebase = max(clock.timebase_hz for clock in clocks)
    step = math.lcm(*(clock.divisor for clock in clocks))
    # Every module must make the common rate with a divider of its own range.
    lowest = max(math.ceil(clock.n_range[0] * clock.divisor / step) for clock in clocks)
    highest = min(clock.n_range[1] * clock.divisor // step for clock in clocks)
    base = timebase / step
    if requested_hz > base / lowest * (1 + 1e-9):
        raise ValueError(f"these modules reach {base / lowest:g} Hz at most, not {requested_hz:g} Hz")
    return base / max(lowest, min(highest, math.floor(base / requested_hz * (1 + 1e-12))))


def coerce_range(product: str | Product, low: float, high: float, measurement: str = "voltage") -> Range:
    """The narrowest input range of the module that holds [low, high]. Raises `ValueError` if none does.

    In amperes for measurement ``current``, V/V for ``bridge``, volts otherwise.
    """
    item = module(product) if isinstance(product, str) else product
    try:
        return coerce_range_of(item.ranges.get(measurement, item.ranges_v), low, high)
    except ValueError as error:
        unit = {"current": "A", "bridge": "V/V"}.get(measurement, "V")
        raise ValueError(f"{error} {unit} of {item.name}") from None


def coerce_range_of(ranges: Sequence[Range], low: float, high: float) -> Range:
    """The first of the ranges (narrowest first) that holds [low, high]. Raises `ValueError`."""
    for bottom, top in ranges:
        slack = 1e-9 * max(abs(bottom), abs(top))
        if bottom - slack <= low < high <= top + slack:
            return (bottom, top)
    widest = ranges[-1]
    raise ValueError(f"{low:g} to {high:g} is not within {widest[0]:g} to {widest[1]:g}")


def input_delay_s(product: str | Product, rate_hz: float) -> float:
    """Lag of the module's digital filter: what sample k shows happened this much before its clock edge.

    0 for SAR converters, and for SC Express modules, which compensate their own delay.
    """
    item = module(product) if isinstance(product, str) else product
    clock = item.delta_sigma
    return clock.delay_samples / rate_hz + clock.delay_s if clock else 0.0


def convert_periods_s(counts: Sequence[tuple[Product, int]], rate_hz: float) -> list[float]:
    """Time between two conversions of each module of a task, given its number of channels in it.

    NI-DAQmx adds 10 µs to each module's fastest period, or less where that leaves no room, and the
    same padding for all modules of a task (NI cDAQ manuals, "AI convert clock").
    """
    padding = PADDING_S
    for item, n in counts:
        if item.converter == "multiplexed" and n > 0:
            room = 1.0 / (n * rate_hz) - item.min_convert_period_s
            padding = max(0.0, min(padding, room))
    return [
        item.min_convert_period_s + padding if item.converter == "multiplexed" else 0.0 for item, _ in counts
    ]


def task_skews_s(channels: Sequence[tuple[str, Product]], rate_hz: float) -> list[float]:
    """Delay after the sample clock of each channel of a task.

    `channels` are (device, its product) in the task's scan order; 0 for simultaneous modules.
    """
    products = dict(channels)
    counts = Counter(device for device, _ in channels)
    periods = dict(
        zip(counts, convert_periods_s([(products[d], n) for d, n in counts.items()], rate_hz), strict=True)
    )
    seen: Counter[str] = Counter()
    skews = []
    for device, _ in channels:
        skews.append(seen[device] * periods[device])
        seen[device] += 1
    return skews


def aggregate_rate_hz(product: Product, n_channels: int, rate_hz: float) -> tuple[float, float]:
    """(conversions per second asked of the module, the most it can do); both per module.

    For modules with a converter for each channel the limit is that of one channel, times n.
    """
    limit = product.aggregate_rate_hz or product.max_rate_hz * n_channels
    if n_channels == 1:
        limit = max(limit, product.max_rate_hz)
    return n_channels * rate_hz, limit


__all__ = [
    "CHASSIS",
    "MODULES",
    "ChassisProduct",
    "Product",
    "UnknownProduct",
    "aggregate_rate_hz",
    "chassis",
    "coerce_range",
    "coerce_rate",
    "convert_periods_s",
    "device_name",
    "input_delay_s",
    "module",
    "task_skews_s",
]

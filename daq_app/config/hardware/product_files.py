"""Product files: TOML tables ``[[product]]`` and ``[[chassis]]`` to products.

A number in a list of ranges stands for ± itself, a pair for its two ends; ``"0-7,16-23"`` names channels.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, get_args

from daq_app.config.errors import ConfigError, Problem
from daq_app.config.hardware.products import (
    NO_COUNTERS,
    NO_OUTPUTS,
    NO_PORTS,
    AnalogOutputs,
    Bus,
    ChassisProduct,
    Converter,
    Counters,
    DeltaSigma,
    DigitalPorts,
    Product,
    Range,
    TerminalConfig,
)
from daq_app.config.toml_file import parse_toml, read_text

_FAMILIES: Final = {"cdaq": "C Series", "pxie": "PXI", "testscale": "TestScale"}


class ProductFault(ValueError):
    """A product table that makes no product; says which product, which key, what is right."""


@dataclass(frozen=True, slots=True)
class ProductSet:
    """Products and chassis by name."""

    products: Mapping[str, Product]
    chassis: Mapping[str, ChassisProduct]


NO_PRODUCTS: Final = ProductSet(MappingProxyType({}), MappingProxyType({}))


def built_in() -> ProductSet:
    """The products that come with the application."""
    folder = resources.files("daq_app.config.hardware") / "product_data"
    tables = [
        parse_toml(file.read_text(encoding="utf-8"), file.name)
        for file in sorted(folder.iterdir(), key=lambda entry: entry.name)
        if file.name.endswith(".toml")
    ]
    return product_set(tables)


def read_product_files(paths: Sequence[Path]) -> ProductSet:
    """The products of a user's files. Raises `ConfigError` with the file and what is wrong."""
    tables = []
    for path in paths:
        table = parse_toml(read_text(path), str(path))
        try:
            product_set([table])
        except ProductFault as fault:
            right = "Compare with the product files that come with the application"
            raise ConfigError([Problem(str(path), "", str(fault), right)]) from None
        tables.append(table)
    return product_set(tables)


def product_set(files: Iterable[Mapping[str, Any]]) -> ProductSet:
    """Products of the tables of several files; a later one replaces an earlier one of the same name.

    Raises `ProductFault`.
    """
    products: dict[str, Product] = {}
    chassis: dict[str, ChassisProduct] = {}
    for file in files:
        unknown = set(file) - {"product", "chassis"}
        if unknown:
            raise ProductFault(f"`{min(unknown)}` is no table of a product file: [[product]], [[chassis]]")
        products |= {table["name"]: _product(table) for table in map(_named, file.get("product", ()))}
        chassis |= {table["name"]: _chassis(table) for table in map(_named, file.get("chassis", ()))}
    return ProductSet(MappingProxyType(products), MappingProxyType(chassis))


def _named(table: object) -> Mapping[str, Any]:
    if not isinstance(table, dict) or not isinstance(table.get("name"), str):
        raise ProductFault('a product without a name: write name = "NI 9205"')
    return table


class _Table:
    """Keys of one table, each asked for once; what nobody asked for is a mistake."""

    def __init__(self, product: str, where: str, table: object) -> None:
        self._label = f"{product}: {where}".rstrip(": ")
        if not isinstance(table, dict):
            raise ProductFault(f"{self._label} is not a table")
        self._rest = dict(table)

    def take(self, key: str, default: Any, *kinds: type) -> Any:
        value = self._rest.pop(key, default)
        if value is None:
            raise ProductFault(f"{self._label}: `{key}` is missing")
        if kinds and (not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds)):
            raise ProductFault(f"{self._label}: `{key}` cannot be {value!r}")
        return value

    def number(self, key: str, default: float | None = None) -> float:
        return float(self.take(key, default, int, float))

    def choice(self, key: str, default: str | None, options: tuple[str, ...]) -> Any:
        value = self.take(key, default, str)
        if value not in options:
            raise ProductFault(f"{self._label}: `{key}` is {value!r}, not one of {', '.join(options)}")
        return value

    def end(self) -> None:
        if self._rest:
            raise ProductFault(f"{self._label}: `{min(self._rest)}` is no key here")


def _product(data: Mapping[str, Any]) -> Product:
    name = str(data["name"])
    table = _Table(name, "", data)
    table.take("name", None)
    bus = table.choice("bus", None, get_args(Bus))
    family = table.take("task_family", _FAMILIES.get(bus, "own"), str)
    shared: dict[str, Any] = {
        "category": table.take("category", "", str),
        "source": table.take("source", "", str),
        "outputs": _outputs(name, table.take("ao", {})),
        "ports": _ports(name, table.take("digital", {})),
        "counters": _counters(name, table.take("counters", {})),
    }
    inputs = table.take("ai", {})
    table.end()
    if not inputs:
        return Product(
            name, bus, family, 0, "simultaneous", 16, {}, (), 0.0, measurements=frozenset(), **shared
        )
    return _with_inputs(name, bus, family, _Table(name, "ai", inputs), shared)


def _with_inputs(name: str, bus: Bus, family: str, table: _Table, shared: dict[str, Any]) -> Product:
    ranges = _ranges_by_quantity(name, table.take("ranges", None, dict))
    product = Product(
        name,
        bus,
        family,
        table.take("n", None, int),
        table.choice("converter", None, get_args(Converter)),
        table.take("bits", None, int),
        _terminals(name, table.take("terminals", None, dict)),
        ranges.get("voltage") or next(iter(ranges.values())),
        table.number("max_rate_hz"),
        table.number("aggregate_rate_hz", 0.0),
        table.number("timebase_hz", 0.0),
        _delta_sigma(name, table.take("delta_sigma", {})),
        frozenset(table.take("measures", None, list)),
        ranges,
        tuple(map(float, table.take("iepe_currents_a", [], list))),
        _pair(name, table.take("excitation_v", [0.0, 0.0], list)),
        _pair(name, table.take("excitation_hz", [0.0, 0.0], list)),
        table.take("teds", False, bool),
        table.take("external_clock", True, bool),
        **shared,
    )
    table.end()
    return product


def _delta_sigma(name: str, data: object) -> DeltaSigma | None:
    if not data:
        return None
    table = _Table(name, "ai.delta_sigma", data)
    low, high = _pair(name, table.take("n_range", None, list))
    clock = DeltaSigma(
        table.number("timebase_hz"),
        table.take("divisor", None, int),
        (int(low), int(high)),
        table.number("delay_samples", 0.0),
        table.number("delay_s", 0.0),
    )
    table.end()
    return clock


def _outputs(name: str, data: object) -> AnalogOutputs:
    if not data:
        return NO_OUTPUTS
    table = _Table(name, "ao", data)
    ranges = _ranges_by_quantity(name, table.take("ranges", None, dict))
    outputs = AnalogOutputs(
        table.take("n", None, int),
        table.take("bits", 16, int),
        ranges.get("voltage", ()),
        ranges.get("current", ()),
        table.number("max_rate_hz", 0.0),
    )
    table.end()
    return outputs


def _ports(name: str, data: object) -> DigitalPorts:
    if not data:
        return NO_PORTS
    table = _Table(name, "digital", data)
    ports = DigitalPorts(
        tuple(table.take("ports", None, list)),
        table.number("max_rate_hz", 0.0),
        table.take("input", True, bool),
        table.take("output", True, bool),
    )
    table.end()
    return ports


def _counters(name: str, data: object) -> Counters:
    if not data:
        return NO_COUNTERS
    table = _Table(name, "counters", data)
    counters = Counters(
        table.take("n", None, int), table.take("bits", 32, int), table.number("max_rate_hz", 0.0)
    )
    table.end()
    return counters


def _chassis(data: Mapping[str, Any]) -> ChassisProduct:
    name = str(data["name"])
    table = _Table(name, "", data)
    table.take("name", None)
    engines = table.take("ai_timing_engines", 0, int)
    chassis = ChassisProduct(
        name,
        table.choice("bus", None, get_args(Bus)),
        tuple(sorted(_numbers(name, table.take("slots", None, str)))),
        engines or None,
        table.number("timebase_hz", 0.0),
        table.take("network_synchronised", False, bool),
        table.take("source", "", str),
    )
    table.end()
    return chassis


def _numbers(name: str, text: str) -> frozenset[int]:
    """``"0-7,16-23"`` → the numbers."""
    out: set[int] = set()
    for part in text.split(","):
        first, _, last = part.strip().partition("-")
        if not first.isdigit() or not (last or first).isdigit():
            raise ProductFault(f"{name}: {text!r} are no numbers: write them as 0-7,16-23")
        out.update(range(int(first), int(last or first) + 1))
    return frozenset(out)


def _terminals(name: str, data: Mapping[str, str]) -> Mapping[TerminalConfig, frozenset[int]]:
    unknown = set(data) - set(get_args(TerminalConfig))
    if unknown:
        raise ProductFault(f"{name}: `{min(unknown)}` is no terminal configuration")
    return MappingProxyType({config: _numbers(name, data[config]) for config in data})  # type: ignore[misc]


def _ranges_by_quantity(name: str, data: Mapping[str, Any]) -> Mapping[str, tuple[Range, ...]]:
    if not data:
        raise ProductFault(f"{name}: `ranges` is empty")
    return MappingProxyType({quantity: _ranges(name, given) for quantity, given in data.items()})


def _ranges(name: str, given: object) -> tuple[Range, ...]:
    """Ranges, narrowest first."""
    if not isinstance(given, list) or not given:
        raise ProductFault(f"{name}: {given!r} are no ranges: write [0.2, 10.0] or [[0.0, 10.0]]")
    pairs = [_pair(name, end if isinstance(end, list) else [-end, end]) for end in given]
    return tuple(sorted(pairs, key=lambda pair: pair[1] - pair[0]))


def _pair(name: str, given: object) -> Range:
    if (
        isinstance(given, list)
        and len(given) == 2
        and all(isinstance(end, int | float) for end in given)
        and given[0] <= given[1]
    ):
        return (float(given[0]), float(given[1]))
    raise ProductFault(f"{name}: {given!r} is no range: write [low, high]")

"""Which module and input each sensor of a new rig gets: one that can read it.

A sensor is read in the first way that it may be read in and that some module has. Among those modules it
takes the first that suits it, and gives its place up for a sensor that has no other while it has another
itself (augmenting paths; Kuhn 1955), so that a sensor stays without an input only where there is none for it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from daq_app.config.authoring.channel_keys import as_channel, channel_keys, measurements_of, reading_range
from daq_app.config.authoring.sensor import Sensor
from daq_app.config.authoring.terminals import chassis_table, devices_in, inputs
from daq_app.config.errors import ConfigError, Problem
from daq_app.config.families import is_auxiliary
from daq_app.config.hardware import catalogue
from daq_app.config.hardware.inventory import Device
from daq_app.config.hardware.products import Product
from daq_app.config.hardware.wiring import wiring_problems

_USUAL: Final[Mapping[str, tuple[str, ...]]] = {
    "cdaq": ("NI 9205", "NI 9234", "NI 9237", "NI 9213", "NI 9203"),
    "pxie": ("PXIe-6345", "PXIe-4340", "PXIe-4492", "PXIe-4331", "PXIe-4353", "PXIe-4311"),
}
"""Bus → modules that a laboratory has for voltages, IEPE, bridges and so on: what is proposed."""
_UNITS: Final = {"current": "A", "bridge": "V/V"}
_TOLERANCE: Final = 1e-6


@dataclass(frozen=True, slots=True)
class Placed:
    """A sensor with its input and the keys of its channel."""

    sensor: Sensor
    keys: Mapping[str, Any]
    assumed: tuple[str, ...]


def place(sensors: Sequence[Sensor], devices: Sequence[Device], rate_hz: float, file: str) -> list[Placed]:
    """Every sensor on an input that can read it; those that name an input keep it.

    Raises `ConfigError` that names each sensor without an input, and why no module reads it.
    """
    table = _Table(devices, rate_hz)
    seats, problems = _seats(sensors, table, file)
    if problems:
        raise ConfigError(problems)
    free = {device.name: iter(_free(device, sensors)) for device in devices}
    placed = []
    for index, sensor in enumerate(sensors):
        device, measurement = seats[index]
        if not sensor.physical_channel and device is not None:
            name = f"{device.name}/ai{next(free[device.name])}"
            sensor = replace(sensor, physical_channel=name)
        product = device.product if device is not None else catalogue.module(_USUAL["cdaq"][0])
        keys, assumed = channel_keys(sensor, measurement, product)
        placed.append(Placed(sensor, keys, tuple(assumed)))
    return placed


def modules_for(sensors: Sequence[Sensor], chassis: str, rate_hz: float, file: str) -> list[str]:
    """Usual modules, as many as the sensors need, where the owner names none."""
    usual = _USUAL[catalogue.chassis(chassis).bus] if chassis in catalogue.CHASSIS else _USUAL["cdaq"]
    modules: list[str] = []
    while True:
        devices = devices_in([chassis_table(chassis, modules, file)], file) if modules else []
        table = _Table(devices, rate_hz)
        proposals = (
            _usual_for(sensor, _voltage_first(sensor), usual, table) for sensor in _unplaced(sensors, table)
        )
        needed = next(filter(None, proposals), "")
        if not needed:
            return modules or [usual[0]]
        modules.append(needed)


class _Table:
    """Which device reads which sensor, asked once for each product."""

    def __init__(self, devices: Sequence[Device], rate_hz: float) -> None:
        self.devices = devices
        self.rate_hz = _common_rate([device.product for device in devices], rate_hz)
        self._faults: dict[tuple[int, str, str], str] = {}

    def fault(self, sensor: Sensor, measurement: str, product: Product) -> str:
        """Why a product cannot read a sensor in that way; empty where it can."""
        key = (id(sensor), measurement, product.name)
        if key not in self._faults:
            self._faults[key] = _fault(sensor, measurement, product, self.rate_hz)
        return self._faults[key]

    def seats_of(self, sensor: Sensor) -> tuple[str, list[Device]]:
        """(how the sensor is read, the devices that can, the most suitable first)."""
        measurements = measurements_of(sensor)
        for measurement in measurements:
            able = [d for d in self.devices if not self.fault(sensor, measurement, d.product)]
            if able:
                return measurement, sorted(able, key=lambda d: _suits(d.product, measurement))
        return measurements[-1], []


def _seats(
    sensors: Sequence[Sensor], table: _Table, file: str
) -> tuple[list[tuple[Device | None, str]], list[Problem]]:
    """(device or None, measurement) of each sensor, and the problems of those that have none."""
    names = {device.name: device for device in table.devices}
    matched = _matched(sensors, table)
    seats: list[tuple[Device | None, str]] = []
    reasons: dict[tuple[str, str], list[str]] = {}
    for index, sensor in enumerate(sensors):
        measurement, able = table.seats_of(sensor)
        device = names.get(sensor.physical_channel.partition("/")[0], matched.get(index))
        if sensor.physical_channel and device is not None:
            ways = measurements_of(sensor)
            measurement = next((w for w in ways if not table.fault(sensor, w, device.product)), ways[-1])
        elif not sensor.physical_channel and device is None:
            reasons.setdefault(_reason(sensor, able, table), []).append(sensor.id)
        seats.append((device, measurement))
    problems = [
        Problem(file, "hardware", f"{_listed(ids)}: {wrong}", right)
        for (wrong, right), ids in reasons.items()
    ]
    return seats, problems


def _unplaced(sensors: Sequence[Sensor], table: _Table) -> list[Sensor]:
    matched = _matched(sensors, table)
    return [s for i, s in enumerate(sensors) if not s.physical_channel and i not in matched]


def _matched(sensors: Sequence[Sensor], table: _Table) -> dict[int, Device]:
    """Index of a sensor without a named input → its device."""
    room = {d.name: min(len(_free(d, sensors)), _capacity(d.product, table.rate_hz)) for d in table.devices}
    able = {i: table.seats_of(s)[1] for i, s in enumerate(sensors) if not s.physical_channel}
    seated: dict[str, list[int]] = {device.name: [] for device in table.devices}
    matched: dict[int, Device] = {}

    def sit(index: int, device: Device) -> bool:
        seated[device.name].append(index)
        matched[index] = device
        return True

    def seat(index: int, tried: set[str]) -> bool:
        for device in able[index]:
            if len(seated[device.name]) < room[device.name]:
                return sit(index, device)
        for device in able[index]:
            if device.name in tried:
                continue
            tried.add(device.name)
            mover = next((other for other in seated[device.name] if seat(other, tried)), None)
            if mover is not None:
                seated[device.name].remove(mover)
                return sit(index, device)
        return False

    for index in able:
        seat(index, set())
    return matched


def _suits(product: Product, measurement: str) -> tuple[bool, bool, float]:
    """Sort key of a module for a sensor: fast ones, those made for it, the narrowest range; then by slot."""
    ranges = product.ranges.get(measurement, product.ranges_v)
    made_for = {"iepe", "bridge", "thermocouple", "lvdt_native"} & product.measurements
    return product.converter == "slow", measurement == "voltage" and bool(made_for), ranges[-1][1]


def _fault(sensor: Sensor, measurement: str, product: Product, rate_hz: float) -> str:
    if not inputs(product):
        return "has no analogue input"
    if product.converter == "slow" and not is_auxiliary(sensor.family):
        return f"makes {product.max_rate_hz:g} samples a second at most"
    if product.converter != "slow" and product.max_rate_hz < rate_hz:
        return f"makes {product.max_rate_hz:g} samples a second at most"
    keys, _ = channel_keys(sensor, measurement, product)
    ai = inputs(product)[0]
    channel = as_channel(sensor, keys, f"D/ai{ai}")
    if channel is None:  # the check of the whole text says what is wrong with the list
        return "" if measurement in product.measurements else "cannot measure it"
    chassis = next(c for c in catalogue.CHASSIS.values() if c.bus == product.bus)
    device = Device("D", product, "C", chassis, 1, "")
    problems = wiring_problems({0: channel}, {"D": device}, "")
    if problems:
        return problems[0].wrong.removeprefix(f"{product.name} ")
    output = reading_range(channel)
    if output is None or measurement == "thermocouple":
        return ""
    (low, high), (least, most) = output, channel.input_range_v
    slack = _TOLERANCE * max(1.0, most - least)
    if low < least - slack or high > most + slack:
        unit = _UNITS.get(measurement, "V")
        return f"reads {least:g} to {most:g} {unit}, not the sensor's {low:.4g} to {high:.4g} {unit}"
    return ""


def _reason(sensor: Sensor, able: Sequence[Device], table: _Table) -> tuple[str, str]:
    """(why a sensor has no input, what would give it one)."""
    bus = table.devices[0].product.bus if table.devices else "cdaq"
    ways = [table.seats_of(sensor)[0]] if able else _voltage_first(sensor)
    usual = _usual_for(sensor, ways, _USUAL.get(bus, _USUAL["cdaq"]), table)
    right = f"Name another module that reads it: --module '{usual}'" if usual else "Use a conditioner"
    if able:
        total = sum(min(len(inputs(d.product)), _capacity(d.product, table.rate_hz)) for d in able)
        listed = ", ".join(dict.fromkeys(device.product.name for device in able))
        return f"no input is left; the sensors need more than the {total} inputs of {listed}", right
    faults = []
    for name, product in {device.product.name: device.product for device in table.devices}.items():
        ways = measurements_of(sensor)
        way = next((w for w in ways if w in product.measurements), ways[-1])
        faults.append(f"{name} {table.fault(sensor, way, product)}")
    return f"no module reads it: {'; '.join(faults) or 'there is none'}", right


def _voltage_first(sensor: Sensor) -> list[str]:
    """How a sensor may be read; what needs no module of its own kind first."""
    return sorted(measurements_of(sensor), key=lambda name: name != "voltage")


def _usual_for(sensor: Sensor, ways: Sequence[str], usual: Sequence[str], table: _Table) -> str:
    """The first usual product that reads a sensor in the first possible of those ways; empty if none does."""
    for way in ways:
        for name in usual:
            if not table.fault(sensor, way, catalogue.module(name)):
                return name
    return ""


def _free(device: Device, sensors: Sequence[Sensor]) -> list[int]:
    """The inputs of a device that no sensor names."""
    taken = {sensor.physical_channel for sensor in sensors}
    return [ai for ai in inputs(device.product) if f"{device.name}/ai{ai}" not in taken]


def _capacity(product: Product, rate_hz: float) -> int:
    """How many channels a module samples at a rate."""
    if product.converter != "multiplexed" or not product.aggregate_rate_hz:
        return product.n_ai
    return int(product.aggregate_rate_hz / rate_hz * (1 + 1e-9))


def _common_rate(products: Sequence[Product], rate_hz: float) -> float:
    """The rate that those modules make of one asked; what they refuse is told by the planner."""
    fast = [product for product in products if product.converter != "slow" and product.n_ai]
    try:
        return catalogue.coerce_rate(fast, rate_hz)
    except ValueError:
        return rate_hz


def _listed(ids: Sequence[str]) -> str:
    counts = Counter(ids)
    names = list(counts)
    return ", ".join(names) if len(names) <= 8 else f"{', '.join(names[:7])} … {names[-1]} ({len(names)})"

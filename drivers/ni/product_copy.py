"""A table of a product file, from the attributes of a device that NI-DAQmx knows."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

import nidaqmx
import nidaqmx.system
from nidaqmx import errors as ni_errors
from nidaqmx.constants import BusType, ProductCategory, TerminalConfiguration

from daq_app.config.hardware.product_files import product_set
from drivers.ni.connection import Connection
from drivers.ni.error_advice import translate
from drivers.ni.probe_task import Probe, probe
from drivers.protocol import DriverError

_BUSES: Final = {
    BusType.COMPACT_DAQ: "cdaq",
    BusType.PCI: "pci",
    BusType.PCIE: "pcie",
    BusType.PXI: "pxi",
    BusType.PXIE: "pxie",
    BusType.USB: "usb",
}
_FAMILIES: Final = {
    ProductCategory.X_SERIES_DAQ: "MIO X Series",
    ProductCategory.M_SERIES_DAQ: "MIO M Series",
    ProductCategory.MIODAQ: "mioDAQ",
    ProductCategory.SC_EXPRESS: "SC Express",
    ProductCategory.DSA: "DSA",
}
_QUANTITIES: Final = ("voltage", "current", "bridge", "resistance", "charge")
_MULTIFUNCTION: Final = "FREQUENCY_VOLTAGE"
"""Only multifunction inputs measure frequencies of voltages."""
_MEASURES: Final = {
    "VOLTAGE": "voltage",
    "VOLTAGE_CUSTOM_WITH_EXCITATION": "voltage_excitation",
    "VOLTAGE_ACRMS": "rms",
    "CURRENT": "current",
    "RESISTANCE": "resistance",
    "TEMPERATURE_RTD": "rtd",
    "TEMPERATURE_THERMOCOUPLE": "thermocouple",
    "TEMPERATURE_BUILT_IN_SENSOR": "built_in_temperature",
    "BRIDGE": "bridge",
    "FORCE_BRIDGE": "force",
    "PRESSURE_BRIDGE": "pressure",
    "TORQUE_BRIDGE": "torque",
    "STRAIN_STRAIN_GAGE": "strain",
    "ROSETTE_STRAIN_GAGE": "rosette",
    "ACCELERATION_ACCELEROMETER_CURRENT_INPUT": "iepe",
    "ACCELERATION_CHARGE": "charge",
    "ACCELERATION_4_WIRE_DC_VOLTAGE": "accel_4wire",
    "SOUND_PRESSURE_MICROPHONE": "microphone",
    "VELOCITY_IEPE_SENSOR": "velocity",
    "FORCE_IEPE_SENSOR": "force_iepe",
    "POSITION_LINEAR_LVDT": "lvdt_native",
    "POSITION_EDDY_CURRENT_PROX_PROBE": "eddy_current",
    "POWER": "power",
    "CALCULATED_POWER": "calculated_power",
}
"""NI's names of what an input measures → the words of product files."""
_DELTA_SIGMA_BITS: Final = 24
"""Simultaneous converters of so many bits or more are delta-sigma converters (GK)."""
_SLOWEST_DELTA_SIGMA_HZ: Final = 1.0
"""C Series modules with a delta-sigma converter do not sample slower than this (GK: 200 Hz at the least);
others go down to the 0.02 Hz of the chassis' clock."""


def describe_product(connection: str, name: str) -> dict[str, Any]:
    """The table ``[[product]]`` of the product that the device called `name` is. Raises `DriverError`."""
    way = Connection(connection)
    way.limit_calls_to()
    try:
        devices = {device.name: device for device in way.system().devices}
        if name not in devices:
            raise DriverError(
                f"There is no device {name}",
                advice=f"Present: {', '.join(sorted(devices)) or 'none'}",
                device=name,
            )
        table = _table(devices[name], way)
    except Exception as error:
        raise translate(error, doing=f"reading the attributes of {name}") from error
    finally:
        way.close()
    product_set([{"product": [table]}])
    return table


def _table(device: nidaqmx.system.Device, way: Connection) -> dict[str, Any]:
    category = device.product_category
    test_scale = category is ProductCategory.TEST_SCALE_MODULE
    bus = "testscale" if test_scale else _BUSES.get(device.bus_type)
    parts = {
        "ai": _inputs(device, way, bus or ""),
        "ao": _outputs(device, way),
        "digital": _ports(device),
        "counters": _counters(device),
    }
    if bus is None or not any(parts.values()):
        raise DriverError(
            f"{device.name} ({device.product_type}) has no channels to describe",
            advice="Name a module or card; a chassis is a table [[chassis]], which lists its slots",
            device=str(device.name),
        )
    version = ".".join(map(str, way.system().driver_version))
    table: dict[str, Any] = {
        "name": str(device.product_type),
        "bus": bus,
        "source": f"read from {device.name} with NI-DAQmx {version}, which does not tell the converter's lag "
        "nor whether it takes a sample clock from outside",
    }
    if category not in (ProductCategory.C_SERIES_MODULE, ProductCategory.UNKNOWN):
        table["category"] = category.name
    if category in _FAMILIES:
        table["task_family"] = _FAMILIES[category]
    return table | {key: part for key, part in parts.items() if part}


def _told(ask: Callable[[], Any], otherwise: Any) -> Any:
    """An attribute, or something else where the device does not have it."""
    try:
        return ask()
    except ni_errors.DaqError:
        return otherwise


def _inputs(device: nidaqmx.system.Device, way: Connection, bus: str) -> dict[str, Any]:
    names = list(device.ai_physical_chans.channel_names)
    if not names:
        return {}
    ranges = _ranges(device, "ai", _QUANTITIES)
    usages = [usage.name for usage in device.ai_meas_types]
    found = probe(way, names[0], usages, ranges)
    simultaneous = bool(_told(lambda: device.ai_simultaneous_sampling_supported, True))
    rate = float(_told(lambda: device.ai_max_single_chan_rate, 0.0))
    slowest = float(_told(lambda: device.ai_min_rate, 0.0))
    divides = bus != "cdaq" or slowest >= _SLOWEST_DELTA_SIGMA_HZ
    table: dict[str, Any] = {
        "n": len(names),
        "converter": _converter(found, simultaneous, divides=divides),
        "bits": found.bits,
        "terminals": _terminals(device, names),
        "ranges": ranges or {"voltage": [[-10.0, 10.0]]},
        "max_rate_hz": rate,
        "measures": _measures(usages),
    }
    if not simultaneous:
        table["aggregate_rate_hz"] = float(_told(lambda: device.ai_max_multi_chan_rate, rate))
    if table["converter"] == "delta_sigma" and bus == "cdaq":
        table["delta_sigma"] = _clock(found, rate, slowest)
    elif table["converter"] != "delta_sigma" and bus != "cdaq":
        table["timebase_hz"] = found.timebase_hz
    currents = list(map(float, _told(lambda: device.ai_current_int_excit_discrete_vals, [])))
    volts = list(map(float, _told(lambda: device.ai_voltage_int_excit_range_vals, [])))
    optional = {"iepe_currents_a": currents, "excitation_v": volts[:2], "teds": _asks_sensors(device)}
    return table | {key: value for key, value in optional.items() if value}


def _asks_sensors(device: nidaqmx.system.Device) -> bool:
    return bool(_told(lambda: device.hwteds_supported, False))


def _ranges(
    device: nidaqmx.system.Device, io: str, quantities: Sequence[str]
) -> dict[str, list[list[float]]]:
    """Electrical quantity → ranges as pairs of their ends, for the quantities that the device has."""
    ranges: dict[str, list[list[float]]] = {}
    for quantity in quantities:
        pairs = _pairs(_told(partial(getattr, device, f"{io}_{quantity}_rngs"), []))
        if pairs:
            ranges[quantity] = pairs
    return ranges


def _pairs(ends: Sequence[float]) -> list[list[float]]:
    return [[float(low), float(high)] for low, high in zip(ends[::2], ends[1::2], strict=False)]


def _converter(found: Probe, simultaneous: bool, *, divides: bool) -> str:
    """The kind of converter; `divides` is whether its slowest rate may be that of a delta-sigma converter."""
    if found.has_timing_modes:
        return "slow"
    if not simultaneous:
        return "multiplexed"
    return "delta_sigma" if divides and found.bits >= _DELTA_SIGMA_BITS else "simultaneous"


def _clock(found: Probe, fastest_hz: float, slowest_hz: float) -> dict[str, Any]:
    """Rates of a delta-sigma module: the timebase over its divisor and a whole number."""
    return {
        "timebase_hz": found.timebase_hz,
        "divisor": max(1, round(found.timebase_hz / fastest_hz)),
        "n_range": [1, max(1, round(fastest_hz / slowest_hz))],
    }


def _measures(usages: Sequence[str]) -> list[str]:
    if _MULTIFUNCTION in usages:
        return ["voltage", "mio"]
    words = [_MEASURES[usage] for usage in usages if usage in _MEASURES]
    return list(dict.fromkeys(words)) or ["voltage"]


def _terminals(device: nidaqmx.system.Device, names: Sequence[str]) -> dict[str, str]:
    """Terminal configuration → the inputs that have it, as in ``0-7,16-23``."""
    having: dict[str, list[int]] = {}
    for place, name in enumerate(names):
        number = re.search(r"/ai(\d+)$", name)
        terminal = device.ai_physical_chans[name.partition("/")[2]]
        for config in _told(partial(getattr, terminal, "ai_term_cfgs"), [TerminalConfiguration.DIFF]):
            having.setdefault(config.name, []).append(int(number[1]) if number else place)
    return {config: _runs(numbers) for config, numbers in having.items()}


def _runs(numbers: Sequence[int]) -> str:
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and number == runs[-1][1] + 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return ",".join(f"{first}-{last}" if first != last else str(first) for first, last in runs)


def _outputs(device: nidaqmx.system.Device, way: Connection) -> dict[str, Any]:
    names = list(device.ao_physical_chans.channel_names)
    ranges = _ranges(device, "ao", ("voltage", "current"))
    if not names or not ranges:
        return {}
    return {
        "n": len(names),
        "bits": probe(way, names[0], [], ranges).bits,
        "ranges": ranges,
        "max_rate_hz": float(_told(lambda: device.ao_max_rate, 0.0)),
    }


def _ports(device: nidaqmx.system.Device) -> dict[str, Any]:
    inputs, outputs = list(device.di_lines.channel_names), list(device.do_lines.channel_names)
    widths: dict[str, int] = {}
    for line in dict.fromkeys([*inputs, *outputs]):
        port = line.rpartition("/")[0]
        widths[port] = widths.get(port, 0) + 1
    if not widths:
        return {}
    rates = [_told(lambda: device.di_max_rate, 0.0), _told(lambda: device.do_max_rate, 0.0)]
    return {
        "ports": list(widths.values()),
        "max_rate_hz": float(max(rates)),
        "input": bool(inputs),
        "output": bool(outputs),
    }


def _counters(device: nidaqmx.system.Device) -> dict[str, Any]:
    count = len([name for name in device.ci_physical_chans.channel_names if re.search(r"/ctr\d+$", name)])
    if not count:
        return {}
    return {
        "n": count,
        "bits": int(_told(lambda: device.ci_max_size, 32)),
        "max_rate_hz": float(_told(lambda: device.ci_max_timebase, 0.0)),
    }

"""Attributes of the system, its devices, their physical channels and their calibration."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from nidaqmx import constants
from nidaqmx.constants import AcquisitionType, BusType, UsageTypeAI

from daq_app.config.hardware import catalogue
from daq_app.config.hardware.products import Product, Range
from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels import metadata
from sim_hardware.daqmx_server.channels.kinds import KINDS
from sim_hardware.daqmx_server.channels.measurements import measurements_of
from sim_hardware.daqmx_server.channels.teds import DataSheet
from sim_hardware.daqmx_server.channels.virtual import USAGES
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.inventory.devices import Device
from sim_hardware.daqmx_server.inventory.terminals import terminals_on
from sim_hardware.daqmx_server.services.attributes.groups import unsupported

DRIVER_VERSION: Final = (26, 0, 0)
"""What the simulated driver says it is; the client uses newer calls from 24.5 on."""

_TERM_CFG_BITS: Final = {"RSE": 1, "NRSE": 2, "DIFF": 4, "PSEUDO_DIFF": 8}
_COUPLING_BITS: Final = {"AC": 1, "DC": 2}
_START_AND_REFERENCE: Final = 4 | 8
_START: Final = 8
_SAMPLE_MODES: Final = [AcquisitionType.FINITE.value, AcquisitionType.CONTINUOUS.value]
_ACCESSORIES: Final = {"RM-24999_A": 0x7992, "SCB-68A": 0x7492, "TB-4330": 0x74B4}
"""NI's numbers of terminal blocks (GK)."""


class _ReadOnly:
    def set(self, bench: Bench, request: Any, name: str, value: Any) -> None:
        raise unsupported(name)

    def reset(self, bench: Bench, request: Any, name: str) -> None:
        raise unsupported(name)


class SystemGroup(_ReadOnly):
    """Version of the driver, and the names of everything it knows."""

    def get(self, bench: Bench, request: Any, name: str) -> Any:
        values: dict[str, Any] = {
            "NIDAQ_MAJOR_VERSION": DRIVER_VERSION[0],
            "NIDAQ_MINOR_VERSION": DRIVER_VERSION[1],
            "NIDAQ_UPDATE_VERSION": DRIVER_VERSION[2],
            "DEV_NAMES": ", ".join(device.name for device in bench.present()),
            "GLOBAL_CHANS": ", ".join(name for name in bench.saved_channels if "/" not in name),
            "TASKS": ", ".join(bench.saved_tasks),
            "SCALES": ", ".join(bench.saved_scales),
        }
        if name not in values:
            raise unsupported(f"Sys_{name}")
        return values[name]


def _ends(ranges: tuple[Range, ...]) -> list[float]:
    return [end for pair in ranges for end in pair]


def _usages(io: str) -> list[int]:
    names = dict.fromkeys(kind.measurement for kind in KINDS.values() if kind.io == io)
    return [USAGES[io][name] for name in names]


_ANY: Final[dict[str, Callable[[Bench, Device], Any]]] = {
    "PRODUCT_TYPE": lambda bench, device: device.product_name,
    "SERIAL_NUM": lambda bench, device: device.serial,
    "PRODUCT_NUM": lambda bench, device: device.product_number,
    "IS_SIMULATED": lambda bench, device: device.simulated,
    "BUS_TYPE": lambda bench, device: device.bus.value,
    "PRODUCT_CATEGORY": lambda bench, device: device.category.value,
    "AI_PHYSICAL_CHANS": lambda bench, device: ", ".join(device.physical_channels),
    "AO_PHYSICAL_CHANS": lambda bench, device: ", ".join(device.outputs),
    "DI_LINES": lambda bench, device: ", ".join(device.lines if _inputs(device) else ()),
    "DI_PORTS": lambda bench, device: ", ".join(device.ports if _inputs(device) else ()),
    "DO_LINES": lambda bench, device: ", ".join(device.lines if _outputs(device) else ()),
    "DO_PORTS": lambda bench, device: ", ".join(device.ports if _outputs(device) else ()),
    "CI_PHYSICAL_CHANS": lambda bench, device: ", ".join(device.counters),
    "CO_PHYSICAL_CHANS": lambda bench, device: ", ".join(device.counters),
    "TERMINALS": lambda bench, device: ", ".join(_terminals(bench, device)),
    "ANLG_TRIG_SUPPORTED": lambda bench, device: bool(device.physical_channels or device.is_chassis),
    "DIG_TRIG_SUPPORTED": lambda bench, device: True,
    "NUM_DMA_CHANS": lambda bench, device: 8,
    "ACCESSORY_PRODUCT_TYPES": lambda bench, device: ", ".join(
        name.partition("_")[0] for _, name in bench.inventory.accessories.get(device.name, ())
    ),
    "ACCESSORY_PRODUCT_NUMS": lambda bench, device: [
        _ACCESSORIES.get(name, 0) for _, name in bench.inventory.accessories.get(device.name, ())
    ],
    "ACCESSORY_SERIAL_NUMS": lambda bench, device: [
        0 for _ in bench.inventory.accessories.get(device.name, ())
    ],
}


def _inputs(device: Device) -> bool:
    return device.product is not None and device.product.ports.input


def _outputs(device: Device) -> bool:
    return device.product is not None and device.product.ports.output


def _terminals(bench: Bench, device: Device) -> list[str]:
    host = bench.inventory.device(bench.inventory.host_of(device))
    return [f"/{host.name}/{terminal}" for terminal in terminals_on(host)]


_CHASSIS: Final[dict[str, Callable[[Bench, Device], Any]]] = {
    "CHASSIS_MODULE_DEV_NAMES": lambda bench, device: ", ".join(
        module.name for module in bench.present() if module.chassis == device.name
    ),
    "AI_NUM_SAMP_TIMING_ENGINES": lambda bench, device: device.timing_engines or 0,
}
_NETWORK: Final[dict[str, Any]] = {"TCPIP_HOSTNAME": "", "TCPIP_ETHERNET_IP": "0.0.0.0"}

_MODULE: Final[dict[str, Callable[[Bench, Device], Any]]] = {
    "COMPACT_DAQ_CHASSIS_DEV_NAME": lambda bench, device: device.chassis,
    "COMPACT_DAQ_SLOT_NUM": lambda bench, device: device.slot,
}
_CARD: Final[dict[str, Callable[[Bench, Device], Any]]] = {
    "PXI_CHASSIS_NUM": lambda bench, device: 1,
    "PXI_SLOT_NUM": lambda bench, device: device.slot,
    "PCI_BUS_NUM": lambda bench, device: 0,
    "PCI_DEV_NUM": lambda bench, device: 0,
}

_AI: Final[dict[str, Callable[[Product], Any]]] = {
    "AI_VOLTAGE_RNGS": lambda product: _ends(product.ranges.get("voltage", ())),
    "AI_CURRENT_RNGS": lambda product: _ends(product.ranges.get("current", ())),
    "AI_BRIDGE_RNGS": lambda product: _ends(product.ranges.get("bridge", ())),
    "AI_RESISTANCE_RNGS": lambda product: _ends(product.ranges.get("resistance", ())),
    "AI_CHARGE_RNGS": lambda product: _ends(product.ranges.get("charge", ())),
    "AI_MAX_SINGLE_CHAN_RATE": lambda product: product.max_rate_hz,
    "AI_MAX_MULTI_CHAN_RATE": lambda product: product.aggregate_rate_hz or product.max_rate_hz,
    "AI_MIN_RATE": lambda product: catalogue.coerce_rate([product], 1e-3) if product.delta_sigma else 0.0,
    "AI_SIMULTANEOUS_SAMPLING_SUPPORTED": lambda product: not product.aggregate_rate_hz,
    "AI_SUPPORTED_MEAS_TYPES": lambda product: [UsageTypeAI[name].value for name in measurements_of(product)],
    "AI_SAMP_MODES": lambda product: _SAMPLE_MODES,
    "AI_COUPLINGS": lambda product: (
        _COUPLING_BITS["AC"] | _COUPLING_BITS["DC"] if product.iepe_currents_a else _COUPLING_BITS["DC"]
    ),
    "AI_TRIG_USAGE": lambda product: _START_AND_REFERENCE,
    "TEDS_HWTEDS_SUPPORTED": lambda product: product.teds,
}
_IEPE: Final[dict[str, Callable[[Product], Any]]] = {
    "AI_CURRENT_INT_EXCIT_DISCRETE_VALS": lambda product: list(product.iepe_currents_a),
}
_EXCITED: Final[dict[str, Callable[[Product], Any]]] = {
    "AI_VOLTAGE_INT_EXCIT_RANGE_VALS": lambda product: list(product.excitation_v),
}
_AO: Final[dict[str, Callable[[Product], Any]]] = {
    "AO_VOLTAGE_RNGS": lambda product: _ends(product.outputs.ranges_v),
    "AO_CURRENT_RNGS": lambda product: _ends(product.outputs.ranges_a),
    "AO_MAX_RATE": lambda product: product.outputs.max_rate_hz,
    "AO_SAMP_CLK_SUPPORTED": lambda product: product.outputs.max_rate_hz > 0,
    "AO_SAMP_MODES": lambda product: _SAMPLE_MODES,
    "AO_TRIG_USAGE": lambda product: _START,
    "AO_SUPPORTED_OUTPUT_TYPES": lambda product: [
        USAGES["AO"][name]
        for name, ranges in (("VOLTAGE", product.outputs.ranges_v), ("CURRENT", product.outputs.ranges_a))
        if ranges
    ],
}
_DIGITAL: Final[dict[str, Callable[[Product], Any]]] = {
    "DI_MAX_RATE": lambda product: product.ports.max_rate_hz,
    "DO_MAX_RATE": lambda product: product.ports.max_rate_hz,
    "DI_TRIG_USAGE": lambda product: _START_AND_REFERENCE,
    "DO_TRIG_USAGE": lambda product: _START,
}
_COUNTERS: Final[dict[str, Callable[[Product], Any]]] = {
    "CI_MAX_SIZE": lambda product: product.counters.bits,
    "CO_MAX_SIZE": lambda product: product.counters.bits,
    "CI_MAX_TIMEBASE": lambda product: product.counters.max_rate_hz,
    "CO_MAX_TIMEBASE": lambda product: product.counters.max_rate_hz,
    "CI_SAMP_CLK_SUPPORTED": lambda product: True,
    "CO_SAMP_CLK_SUPPORTED": lambda product: True,
    "CI_SAMP_MODES": lambda product: _SAMPLE_MODES,
    "CO_SAMP_MODES": lambda product: _SAMPLE_MODES,
    "CI_SUPPORTED_MEAS_TYPES": lambda product: _usages("CI"),
    "CO_SUPPORTED_OUTPUT_TYPES": lambda product: _usages("CO"),
    "CI_TRIG_USAGE": lambda product: _START,
    "CO_TRIG_USAGE": lambda product: _START,
}


class DeviceGroup(_ReadOnly):
    """Attributes of a device, by what its product has."""

    def get(self, bench: Bench, request: Any, name: str) -> Any:
        bench.exchange_modules()
        device = bench.inventory.device(request.device_name)
        product = device.product
        tables: list[tuple[bool, dict[str, Any]]] = [
            (product is not None and product.n_ai > 0, _AI),
            (product is not None and bool(product.iepe_currents_a), _IEPE),
            (product is not None and product.excitation_v[1] > 0, _EXCITED),
            (product is not None and product.outputs.n > 0, _AO),
            (product is not None and bool(product.ports.lines), _DIGITAL),
            (product is not None and product.counters.n > 0, _COUNTERS),
        ]
        for applies, table in tables:
            if applies and name in table:
                return table[name](product)
        of_place: list[tuple[bool, dict[str, Callable[[Bench, Device], Any]]]] = [
            (True, _ANY),
            (device.is_chassis, _CHASSIS),
            (bool(device.chassis), _MODULE),
            (not device.chassis and not device.is_chassis, _CARD),
        ]
        for applies, entries in of_place:
            if applies and name in entries:
                return entries[name](bench, device)
        if device.bus is BusType.TCPIP and name in _NETWORK:
            return _NETWORK[name]
        plain = name in metadata.attributes_of("Device") and name.endswith(("_SUPPORTED", "_RNGS", "_GAINS"))
        if plain and not name.startswith(("AI_", "AO_", "CI_", "CO_")):
            return metadata.default_of("Device", name)
        raise unsupported(f"Dev_{name}", f"Device Specified: {device.name}")


_TEDS: Final[dict[str, Callable[[DataSheet], Any]]] = {
    "PHYSICAL_CHAN_TEDS_MFG_ID": lambda sheet: sheet.manufacturer,
    "PHYSICAL_CHAN_TEDS_MODEL_NUM": lambda sheet: sheet.model,
    "PHYSICAL_CHAN_TEDS_SERIAL_NUM": lambda sheet: sheet.serial,
    "PHYSICAL_CHAN_TEDS_VERSION_NUM": lambda sheet: sheet.version,
    "PHYSICAL_CHAN_TEDS_VERSION_LETTER": lambda sheet: sheet.letter,
    "PHYSICAL_CHAN_TEDS_BIT_STREAM": lambda sheet: sheet.stream,
    "PHYSICAL_CHAN_TEDS_TEMPLATE_I_DS": lambda sheet: [sheet.template],
}


class PhysicalChannelGroup(_ReadOnly):
    """Attributes of physical channels, and of the data sheets of the sensors on them."""

    def get(self, bench: Bench, request: Any, name: str) -> Any:
        channel = request.physical_channel
        device, terminal = bench.inventory.split(channel)
        if "port" in terminal or "line" in terminal:
            return self._digital(bench, channel, name)
        if terminal.startswith("ao"):
            return self._output(device, name, channel)
        if terminal.startswith("ctr"):
            return self._counter(name, channel)
        device, number = bench.inventory.physical_channel(channel)
        assert device.product is not None
        if name == "PHYSICAL_CHAN_AI_TERM_CFGS":
            configs = device.product.terminals
            return sum(_TERM_CFG_BITS[config] for config, numbers in configs.items() if number in numbers)
        if name == "PHYSICAL_CHAN_AI_SUPPORTED_MEAS_TYPES":
            return [UsageTypeAI[kind].value for kind in measurements_of(device.product)]
        if name == "PHYSICAL_CHAN_AI_INPUT_SRCS":
            return "_external_channel"
        sheet = bench.data_sheets.get(device.physical_channels[number] if number >= 0 else "")
        if name.startswith("PHYSICAL_CHAN_TEDS") and sheet is None:
            raise DaqmxError(Code.TEDS_NOT_DETECTED, f"Physical Channel Name: {channel}")
        if sheet is not None and name in _TEDS:
            return _TEDS[name](sheet)
        raise _no_attribute(name, channel)

    @staticmethod
    def _digital(bench: Bench, channel: str, name: str) -> Any:
        device, lines = bench.inventory.digital_lines(channel)
        assert device.product is not None
        values: dict[str, Any] = {
            "PHYSICAL_CHAN_DI_PORT_WIDTH": len(lines),
            "PHYSICAL_CHAN_DO_PORT_WIDTH": len(lines),
            "PHYSICAL_CHAN_DI_SAMP_CLK_SUPPORTED": device.product.ports.max_rate_hz > 0,
            "PHYSICAL_CHAN_DO_SAMP_CLK_SUPPORTED": device.product.ports.max_rate_hz > 0,
            "PHYSICAL_CHAN_DI_CHANGE_DETECT_SUPPORTED": device.product.ports.input,
            "PHYSICAL_CHAN_DI_SAMP_MODES": _SAMPLE_MODES,
            "PHYSICAL_CHAN_DO_SAMP_MODES": _SAMPLE_MODES,
            "PHYSICAL_CHAN_DIG_PORT_LOGIC_FAMILY": constants.LogicFamily.FIVE_V.value,
        }
        if name not in values:
            raise _no_attribute(name, channel)
        return values[name]

    @staticmethod
    def _output(device: Device, name: str, channel: str) -> Any:
        assert device.product is not None
        if name == "PHYSICAL_CHAN_AO_TERM_CFGS":
            return _TERM_CFG_BITS["RSE"]
        if name == "PHYSICAL_CHAN_AO_SUPPORTED_OUTPUT_TYPES":
            return _AO["AO_SUPPORTED_OUTPUT_TYPES"](device.product)
        raise _no_attribute(name, channel)

    @staticmethod
    def _counter(name: str, channel: str) -> Any:
        if name == "PHYSICAL_CHAN_CI_SUPPORTED_MEAS_TYPES":
            return _usages("CI")
        if name == "PHYSICAL_CHAN_CO_SUPPORTED_OUTPUT_TYPES":
            return _usages("CO")
        raise _no_attribute(name, channel)


def _no_attribute(name: str, channel: str) -> DaqmxError:
    return DaqmxError(
        Code.ATTRIBUTE_UNSUPPORTED, f"Property: DAQmx_{name}", f"Physical Channel Name: {channel}"
    )


_CALIBRATION: Final[dict[str, Any]] = {
    "SELF_CAL_SUPPORTED": True,
    "EXT_CAL_RECOMMENDED_INTERVAL": 24,
    "CAL_USER_DEFINED_INFO_MAX_SIZE": 4,
}


class CalibrationGroup:
    """When and how a device was calibrated; a simulated one has its defaults."""

    def get(self, bench: Bench, request: Any, name: str) -> Any:
        device = bench.inventory.device(request.device_name)
        if "ACC" in name:
            raise DaqmxError(Code.ATTRIBUTE_NOT_SUPPORTED, f"Property: DAQmx_Cal_{name}")
        kept = bench.calibration.get((device.name, name))
        if kept is not None:
            return kept
        return _CALIBRATION.get(name, metadata.default_of("CalInfo", name))

    def set(self, bench: Bench, request: Any, name: str, value: Any) -> None:
        device = bench.inventory.device(request.device_name)
        bench.calibration[device.name, name] = value

    def reset(self, bench: Bench, request: Any, name: str) -> None:
        raise unsupported(f"Cal_{name}")

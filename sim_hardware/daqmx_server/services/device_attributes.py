"""Attributes of the system, its devices and their physical channels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from nidaqmx.constants import AcquisitionType, UsageTypeAI

from daq_app.config.hardware import catalogue
from daq_app.config.hardware.products import Product
from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels.virtual import measurements_of
from sim_hardware.daqmx_server.inventory.devices import Device
from sim_hardware.daqmx_server.services.attributes import unsupported

DRIVER_VERSION: Final = (26, 0, 0)
"""What the simulated driver says it is; the client uses newer calls from 24.5 on."""

_TERM_CFG_BITS: Final = {"RSE": 1, "NRSE": 2, "DIFF": 4, "PSEUDO_DIFF": 8}
_COUPLING_BITS: Final = {"AC": 1, "DC": 2}
_START_AND_REFERENCE: Final = 4 | 8


class _ReadOnly:
    def set(self, bench: Bench, request: Any, name: str, value: Any) -> None:
        raise unsupported(name)

    def reset(self, bench: Bench, request: Any, name: str) -> None:
        raise unsupported(name)


class SystemGroup(_ReadOnly):
    def get(self, bench: Bench, request: Any, name: str) -> Any:
        values: dict[str, Any] = {
            "NIDAQ_MAJOR_VERSION": DRIVER_VERSION[0],
            "NIDAQ_MINOR_VERSION": DRIVER_VERSION[1],
            "NIDAQ_UPDATE_VERSION": DRIVER_VERSION[2],
            "DEV_NAMES": ", ".join(device.name for device in bench.present()),
            "GLOBAL_CHANS": "",
            "TASKS": "",
            "SCALES": "",
        }
        if name not in values:
            raise unsupported(f"Sys_{name}")
        return values[name]


def _terminals(bench: Bench, device: Device) -> str:
    host = bench.inventory.host_of(device)
    names = [f"/{host}/ai/{signal}" for signal in ("SampleClock", "StartTrigger", "ReferenceTrigger")]
    return ", ".join([*names, f"/{host}/PFI0", f"/{host}/PFI1"])


_ANY: Final[dict[str, Callable[[Bench, Device], Any]]] = {
    "PRODUCT_TYPE": lambda bench, device: device.product_name,
    "SERIAL_NUM": lambda bench, device: device.serial,
    "PRODUCT_NUM": lambda bench, device: device.product_number,
    "IS_SIMULATED": lambda bench, device: True,
    "BUS_TYPE": lambda bench, device: device.bus.value,
    "PRODUCT_CATEGORY": lambda bench, device: device.category.value,
    "AI_PHYSICAL_CHANS": lambda bench, device: ", ".join(device.physical_channels),
    "TERMINALS": _terminals,
    "ANLG_TRIG_SUPPORTED": lambda bench, device: True,
    "DIG_TRIG_SUPPORTED": lambda bench, device: True,
    **{
        name: (lambda bench, device: "")
        for name in ("AO_PHYSICAL_CHANS", "DI_LINES", "DI_PORTS", "DO_LINES", "DO_PORTS", "CI_PHYSICAL_CHANS")
    },
    "CO_PHYSICAL_CHANS": lambda bench, device: "",
}

_CHASSIS: Final[dict[str, Callable[[Bench, Device], Any]]] = {
    "CHASSIS_MODULE_DEV_NAMES": lambda bench, device: ", ".join(
        module.name for module in bench.present() if module.chassis == device.name
    ),
    "AI_NUM_SAMP_TIMING_ENGINES": lambda bench, device: device.timing_engines or 0,
}

_MODULE: Final[dict[str, Callable[[Bench, Device], Any]]] = {
    "COMPACT_DAQ_CHASSIS_DEV_NAME": lambda bench, device: device.chassis,
    "COMPACT_DAQ_SLOT_NUM": lambda bench, device: device.slot,
}


def _voltage_ranges(product: Product) -> list[float]:
    return [end for pair in product.ranges_v for end in pair]


_AI: Final[dict[str, Callable[[Product], Any]]] = {
    "AI_VOLTAGE_RNGS": _voltage_ranges,
    "AI_MAX_SINGLE_CHAN_RATE": lambda product: product.max_rate_hz,
    "AI_MAX_MULTI_CHAN_RATE": lambda product: product.aggregate_rate_hz or product.max_rate_hz,
    "AI_MIN_RATE": lambda product: catalogue.coerce_rate([product], 1e-3) if product.delta_sigma else 0.0,
    "AI_SIMULTANEOUS_SAMPLING_SUPPORTED": lambda product: not product.aggregate_rate_hz,
    "AI_SUPPORTED_MEAS_TYPES": lambda product: [UsageTypeAI[name].value for name in measurements_of(product)],
    "AI_SAMP_MODES": lambda product: [AcquisitionType.FINITE.value, AcquisitionType.CONTINUOUS.value],
    "AI_COUPLINGS": lambda product: (
        _COUPLING_BITS["AC"] | _COUPLING_BITS["DC"] if product.iepe_currents_a else _COUPLING_BITS["DC"]
    ),
    "AI_TRIG_USAGE": lambda product: _START_AND_REFERENCE,
    "AI_CURRENT_INT_EXCIT_DISCRETE_VALS": lambda product: list(product.iepe_currents_a),
}


class DeviceGroup(_ReadOnly):
    def get(self, bench: Bench, request: Any, name: str) -> Any:
        bench.exchange_modules()
        device = bench.inventory.device(request.device_name)
        if name in _ANY:
            return _ANY[name](bench, device)
        if device.is_chassis and name in _CHASSIS:
            return _CHASSIS[name](bench, device)
        if device.chassis and name in _MODULE:
            return _MODULE[name](bench, device)
        if device.product is not None and name in _AI:
            return _AI[name](device.product)
        raise unsupported(f"Dev_{name}", f"Device Specified: {device.name}")


class PhysicalChannelGroup(_ReadOnly):
    def get(self, bench: Bench, request: Any, name: str) -> Any:
        device, number = bench.inventory.physical_channel(request.physical_channel)
        assert device.product is not None
        if name == "PHYSICAL_CHAN_AI_TERM_CFGS":
            configs = device.product.terminals
            return sum(_TERM_CFG_BITS[config] for config, numbers in configs.items() if number in numbers)
        if name == "PHYSICAL_CHAN_AI_SUPPORTED_MEAS_TYPES":
            return [UsageTypeAI[kind].value for kind in measurements_of(device.product)]
        if name == "PHYSICAL_CHAN_AI_INPUT_SRCS":
            return "_external_channel"
        raise unsupported(name, f"Physical Channel Name: {request.physical_channel}")

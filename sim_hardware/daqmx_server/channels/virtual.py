"""Virtual analogue-input channels: creation, scaling, and what the converter behind them is."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from nidaqmx.constants import (
    AccelSensitivityUnits,
    AccelUnits,
    ChannelType,
    Coupling,
    ExcitationSource,
    LengthUnits,
    LVDTSensitivityUnits,
    TerminalConfiguration,
    UsageTypeAI,
    VoltageUnits,
)

from daq_app.config.hardware import catalogue
from daq_app.config.hardware.products import Product
from sim_hardware.daqmx_server.channels.converter import Converter
from sim_hardware.daqmx_server.channels.scale import CustomScale
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.inventory.devices import Device, Inventory, channel_list

_G: Final = 9.80665
_INCH_M: Final = 0.0254


@dataclass(frozen=True, slots=True)
class ChannelKind:
    """One of NI's ``CreateAI…Chan`` calls."""

    measurement: str
    """Name in `UsageTypeAI`."""
    attributes: dict[str, str]
    """Field of the request → channel attribute that keeps it."""


_COMMON: Final = {
    "terminal_config": "AI_TERM_CFG",
    "min_val": "AI_MIN",
    "max_val": "AI_MAX",
    "custom_scale_name": "AI_CUSTOM_SCALE_NAME",
    "current_excit_source": "AI_EXCIT_SRC",
    "current_excit_val": "AI_EXCIT_VAL",
    "voltage_excit_source": "AI_EXCIT_SRC",
    "voltage_excit_val": "AI_EXCIT_VAL",
    "voltage_excit_freq": "AI_AC_EXCIT_FREQ",
    "ac_excit_wire_mode": "AI_AC_EXCIT_WIRE_MODE",
    "use_excit_for_scaling": "AI_EXCIT_USE_FOR_SCALING",
    "bridge_config": "AI_BRIDGE_CFG",
}


def _kind(measurement: str, **own: str) -> ChannelKind:
    return ChannelKind(measurement, _COMMON | own)


KINDS: Final[dict[str, ChannelKind]] = {
    "CreateAIVoltageChan": _kind("VOLTAGE", units="AI_VOLTAGE_UNITS"),
    "CreateAIVoltageChanWithExcit": _kind("VOLTAGE_CUSTOM_WITH_EXCITATION", units="AI_VOLTAGE_UNITS"),
    "CreateAIAccelChan": _kind(
        "ACCELERATION_ACCELEROMETER_CURRENT_INPUT",
        units="AI_ACCEL_UNITS",
        sensitivity="AI_ACCEL_SENSITIVITY",
        sensitivity_units="AI_ACCEL_SENSITIVITY_UNITS",
    ),
    "CreateAIPosLVDTChan": _kind(
        "POSITION_LINEAR_LVDT",
        units="AI_LVDT_UNITS",
        sensitivity="AI_LVDT_SENSITIVITY",
        sensitivity_units="AI_LVDT_SENSITIVITY_UNITS",
    ),
}
"""Measurements of this laboratory's sensors; the other ``CreateAI…`` calls answer −200431."""

_UNITS_PER_SI: Final = {
    VoltageUnits.VOLTS.value: 1.0,
    AccelUnits.G.value: 1.0 / _G,
    AccelUnits.METERS_PER_SECOND_SQUARED.value: 1.0,
    AccelUnits.INCHES_PER_SECOND_SQUARED.value: 1.0 / _INCH_M,
    LengthUnits.METERS.value: 1.0,
    LengthUnits.INCHES.value: 1.0 / _INCH_M,
}
_UNIT_NAMES: Final = {
    AccelUnits.G.value: "g",
    AccelUnits.METERS_PER_SECOND_SQUARED.value: "m/s^2",
    AccelUnits.INCHES_PER_SECOND_SQUARED.value: "in/s^2",
    LengthUnits.METERS.value: "Meters",
    LengthUnits.INCHES.value: "Inches",
}
_SI_PER_SENSITIVITY: Final = {
    AccelSensitivityUnits.MILLIVOLTS_PER_G.value: 1e-3 / _G,
    AccelSensitivityUnits.VOLTS_PER_G.value: 1.0 / _G,
    LVDTSensitivityUnits.MILLIVOLTS_PER_VOLT_PER_MILLIMETER.value: 1.0,
    LVDTSensitivityUnits.MILLIVOLTS_PER_VOLT_PER_MILLI_INCH.value: 1.0 / (_INCH_M),
}

_MEASUREMENTS: Final[dict[str, tuple[str, ...]]] = {
    "voltage": ("VOLTAGE", "VOLTAGE_CUSTOM_WITH_EXCITATION"),
    "iepe": ("ACCELERATION_ACCELEROMETER_CURRENT_INPUT",),
    "lvdt_native": ("POSITION_LINEAR_LVDT",),
}


def measurements_of(product: Product) -> list[str]:
    """Names in `UsageTypeAI` of what a product can measure here."""
    return [name for known in sorted(product.measurements) for name in _MEASUREMENTS[known]]


@dataclass(slots=True)
class VirtualChannel:
    """One channel of a task. `attributes` holds what was asked for; coerced values are derived."""

    name: str
    physical: str
    device: Device
    number: int
    kind: ChannelKind
    created_with: dict[str, Any] = field(default_factory=dict)
    attributes: dict[str, Any] = field(default_factory=dict)
    scale: CustomScale | None = None
    """Custom scale of the readings."""

    @property
    def settable(self) -> frozenset[str]:
        """Attributes that a client may set on this kind of channel."""
        return frozenset(self.created_with) | {"CHAN_DESCR", "AI_COUPLING"}

    @property
    def raw_bytes(self) -> int:
        return 2 if self.product.bits <= 16 else 4

    @property
    def product(self) -> Product:
        assert self.device.product is not None
        return self.device.product

    @property
    def measurement(self) -> str:
        return self.kind.measurement

    @property
    def hold_s(self) -> float:
        """Period of a converter that is slower than the task; 0 for one that keeps up."""
        return 1.0 / self.product.max_rate_hz if self.product.converter == "slow" else 0.0

    @property
    def unit_name(self) -> str:
        """Unit of the readings, as NI's waveforms name it."""
        if self.scale is not None:
            return self.scale.scaled_units
        units = next(
            (
                self.attributes[name]
                for name in ("AI_ACCEL_UNITS", "AI_LVDT_UNITS")
                if name in self.attributes
            ),
            None,
        )
        return _UNIT_NAMES.get(units, "Volts")

    @property
    def default_coupling(self) -> Coupling:
        """IEPE modules couple AC (their signal sits on the bias voltage), all others DC."""
        return Coupling.AC if "iepe" in self.product.measurements else Coupling.DC

    @property
    def overload_detection(self) -> bool:
        """Delta-sigma modules watch their inputs for overload; multiplexed ones do not (GK)."""
        return self.product.converter == "delta_sigma"

    @property
    def terminal_config(self) -> str:
        asked = self.attributes.get("AI_TERM_CFG", TerminalConfiguration.DEFAULT.value)
        if asked in (TerminalConfiguration.DEFAULT.value, 0):
            for config, numbers in self.product.terminals.items():
                if self.number in numbers:
                    return config
        return str(TerminalConfiguration(asked).name)

    @property
    def unit_per_electrical(self) -> float:
        """Reading per unit of the electrical quantity (volts; volts per volt of excitation for LVDTs)."""
        attributes = self.attributes
        if self.measurement == "POSITION_LINEAR_LVDT":
            prefix = "AI_LVDT"
        elif self.measurement == "ACCELERATION_ACCELEROMETER_CURRENT_INPUT":
            prefix = "AI_ACCEL"
        elif attributes.get("AI_EXCIT_USE_FOR_SCALING"):
            return 1.0 / float(attributes["AI_EXCIT_VAL"])
        else:
            return 1.0
        electrical_per_si = (
            float(attributes[f"{prefix}_SENSITIVITY"])
            * _SI_PER_SENSITIVITY[attributes[f"{prefix}_SENSITIVITY_UNITS"]]
        )
        units = self.scale.pre_scaled_units if self.scale else attributes[f"{prefix}_UNITS"]
        return _UNITS_PER_SI[units] / electrical_per_si

    @property
    def limits_electrical(self) -> tuple[float, float]:
        """The smallest and largest value expected (AI.Min, AI.Max), in the electrical quantity."""
        low, high = float(self.attributes["AI_MIN"]), float(self.attributes["AI_MAX"])
        if self.scale is not None:
            low, high = sorted((self.scale.inverse(low), self.scale.inverse(high)))
        return low / self.unit_per_electrical, high / self.unit_per_electrical

    @property
    def volts_per_electrical(self) -> float:
        """Volts at the terminals per unit of the electrical quantity."""
        return float(self.attributes["AI_EXCIT_VAL"]) if self.measurement == "POSITION_LINEAR_LVDT" else 1.0

    @property
    def input_range_v(self) -> tuple[float, float]:
        """Smallest range of the module that holds what was asked for; −200077 if none does."""
        low, high = (limit * self.volts_per_electrical for limit in self.limits_electrical)
        with contextlib.suppress(ValueError):
            return catalogue.coerce_range(self.product, low, high)
        widest = self.product.ranges_v[-1]
        end = "Max" if high > widest[1] else "Min"
        per_volt = 1.0 if self.scale else self.unit_per_electrical / self.volts_per_electrical
        raise DaqmxError(
            Code.INVALID_VALUE,
            f"Property: DAQmx_AI_{end}\nRequested Value: {self.attributes[f'AI_{end.upper()}']}\n"
            f"Maximum Value: {widest[1] * per_volt}\nMinimum Value: {widest[0] * per_volt}",
            f"Channel Name: {self.name}",
        )

    @property
    def converter(self) -> Converter:
        """The converter in the electrical quantity of the signal source."""
        low, high = self.input_range_v
        scale = 1.0 / self.volts_per_electrical
        return Converter(low * scale, high * scale, self.product.bits)

    def verify(self) -> None:
        """Raise what NI-DAQmx raises for values that the module cannot do."""
        if float(self.attributes["AI_MIN"]) >= float(self.attributes["AI_MAX"]):
            raise DaqmxError(Code.MIN_NOT_BELOW_MAX, f"Channel Name: {self.name}")
        configs = self.product.terminals
        wanted = self.terminal_config
        if all(wanted != name or self.number not in numbers for name, numbers in configs.items()):
            possible = [name for name, numbers in configs.items() if self.number in numbers]
            self._refuse(
                "DAQmx_AI_TermCfg", f"DAQmx_Val_{wanted}", [f"DAQmx_Val_{name}" for name in possible]
            )
        currents = (0.0, *self.product.iepe_currents_a)
        if (
            self.measurement == "ACCELERATION_ACCELEROMETER_CURRENT_INPUT"
            and self.attributes.get("AI_EXCIT_SRC") == ExcitationSource.INTERNAL.value
            and not any(abs(self.attributes["AI_EXCIT_VAL"] - current) < 1e-9 for current in currents)
        ):
            self._refuse("DAQmx_AI_Excit_Val", self.attributes["AI_EXCIT_VAL"], list(currents))
        _ = self.input_range_v

    def _refuse(self, name: str, asked: object, possible: list[Any]) -> None:
        raise DaqmxError(
            Code.INVALID_VALUE,
            f"Property: {name}\nRequested Value: {asked}\nPossible Values: {', '.join(map(str, possible))}",
            f"Channel Name: {self.name}",
        )


def _scale_of(scales: Mapping[str, CustomScale], fields: dict[str, Any]) -> CustomScale | None:
    """The custom scale a call asks for: −200447 if its units do not say so, −200378 if it is unknown."""
    name = fields.get("custom_scale_name", "")
    if fields.get("units") != VoltageUnits.FROM_CUSTOM_SCALE.value:
        if name:
            raise DaqmxError(Code.UNITS_NOT_CUSTOM, f"Custom Scale Name: {name}")
        return None
    if name not in scales:
        raise DaqmxError(Code.SCALE_UNKNOWN, f"Custom Scale Name: {name}")
    return scales[name]


def create_channels(
    inventory: Inventory,
    scales: Mapping[str, CustomScale],
    rpc: str,
    fields: dict[str, Any],
    existing: set[str],
) -> list[VirtualChannel]:
    """The virtual channels that one ``CreateAI…Chan`` call asks for."""
    physical = channel_list(fields["physical_channel"])
    if not physical:
        raise DaqmxError(Code.PHYSICAL_CHANNEL_UNKNOWN, "Physical Channel Name: (none)")
    kind = KINDS.get(rpc)
    scale = _scale_of(scales, fields)
    out: list[VirtualChannel] = []
    for name, terminal in zip(_names(fields["name_to_assign_to_channel"], physical), physical, strict=True):
        device, number = inventory.physical_channel(terminal)
        assert device.product is not None
        if kind is None or kind.measurement not in measurements_of(device.product):
            raise DaqmxError(
                Code.MEASUREMENT_TYPE_UNSUPPORTED,
                f"Property: DAQmx_AI_MeasType\nRequested Value: {kind.measurement if kind else rpc}",
                f"Physical Channel Name: {terminal}",
            )
        if name in existing or any(name == other.name for other in out):
            raise DaqmxError(Code.CHANNEL_ALREADY_IN_TASK, f"Channel Name: {name}")
        attributes = {kind.attributes[key]: value for key, value in fields.items() if key in kind.attributes}
        channel = VirtualChannel(
            name, f"{device.name}/ai{number}", device, number, kind, dict(attributes), attributes, scale
        )
        if float(attributes["AI_MIN"]) >= float(attributes["AI_MAX"]):
            raise DaqmxError(Code.MIN_NOT_BELOW_MAX, f"Channel Name: {name}")
        out.append(channel)
    return out


def _names(assigned: str, physical: list[str]) -> list[str]:
    """Names as NI gives them: a list is taken one by one, one name for several gets numbers."""
    names = channel_list(assigned)
    if not names:
        return physical
    if len(names) == len(physical):
        return names
    return [f"{names[0]}{i}" for i in range(len(physical))]


CHANNEL_TYPE: Final = ChannelType.ANALOG_INPUT.value
USAGE: Final = {usage.name: usage.value for usage in UsageTypeAI}

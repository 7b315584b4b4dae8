"""Analogue-input channels: range, converter, and the way from the electrical quantity to the reading."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from typing import Final

from nidaqmx.constants import Coupling, ExcitationSource, TEDSUnits, TerminalConfiguration, VoltageUnits

from daq_app.config.hardware import catalogue
from daq_app.config.hardware.products import Range
from sim_hardware.daqmx_server.channels.applicability import has_attribute
from sim_hardware.daqmx_server.channels.converter import Converter
from sim_hardware.daqmx_server.channels.measurements import (
    QUANTITIES,
    SI_PER_SENSITIVITY,
    UNIT_NAMES,
    UNITS_PER_SI,
)
from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.errors import Code, DaqmxError

_EXCITED: Final = ("POSITION_LINEAR_LVDT", "POSITION_ANGULAR_RVDT")
"""Measurements whose signal is a ratio to the excitation."""


@dataclass(slots=True)
class AnalogInput(VirtualChannel):
    """An analogue-input channel."""

    def applies(self, attribute: str) -> bool:
        units = self.kind.attributes.get("units", "")
        return VirtualChannel.applies(self, attribute) and has_attribute(
            attribute, self.measurement, units, self.product
        )

    @property
    def raw_bytes(self) -> int:
        return 2 if self.product.bits <= 16 else 4

    @property
    def hold_s(self) -> float:
        """Period of a converter that is slower than the task; 0 for one that keeps up."""
        return 1.0 / self.product.max_rate_hz if self.product.converter == "slow" else 0.0

    @property
    def units(self) -> int:
        """NI's number of the reading's unit; 0 where the measurement has none."""
        return int(self.attributes.get(self.kind.attributes.get("units", ""), 0))

    @property
    def unit_name(self) -> str:
        if self.scale is not None:
            return self.scale.scaled_units
        return UNIT_NAMES.get(self.units, "Volts")

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
                if self.number in numbers or self.number < 0:
                    return config
        return str(TerminalConfiguration(asked).name)

    @property
    def quantity(self) -> str:
        """Electrical quantity whose ranges count; empty for a measurement that is not proportional to one."""
        return "" if self.in_sensor_units else QUANTITIES.get(self.measurement, "")

    @property
    def in_sensor_units(self) -> bool:
        """Whether the reading is in the unit of the sensor's data sheet, which its template scales to."""
        return self.kind.teds and self.units == _FROM_TEDS

    @property
    def unit_per_electrical(self) -> float:
        """Reading per unit of the electrical quantity (volts; volts per volt of excitation for LVDTs)."""
        attributes = self.attributes
        ratiometric = attributes.get("AI_EXCIT_USE_FOR_SCALING", False)
        if self.measurement == "VOLTAGE_CUSTOM_WITH_EXCITATION" and ratiometric:
            return 1.0 / float(attributes["AI_EXCIT_VAL"])
        units = self.scale.pre_scaled_units if self.scale else self.units
        per_si = UNITS_PER_SI.get(units, 1.0) if self.quantity else 1.0
        if self.measurement == _MICROPHONE:
            return per_si / (1e-3 * float(attributes["AI_MICROPHONE_SENSITIVITY"]))
        sensitivity = self.kind.attributes.get("sensitivity")
        if sensitivity is None or sensitivity not in attributes:
            return per_si
        electrical = float(attributes[sensitivity]) * SI_PER_SENSITIVITY[attributes[f"{sensitivity}_UNITS"]]
        return per_si / electrical

    @property
    def limits(self) -> Range:
        """The smallest and largest value expected (AI.Min, AI.Max), in the unit of the reading."""
        if "AI_MAX" not in self.attributes and self.measurement == _MICROPHONE:
            level_db = float(self.attributes["AI_SOUND_PRESSURE_MAX_SOUND_PRESSURE_LVL"])
            highest_pa = _HEARING_THRESHOLD_PA * 10.0 ** (level_db / 20.0)
            return -highest_pa, highest_pa
        return float(self.attributes.get("AI_MIN", 0.0)), float(self.attributes.get("AI_MAX", 1.0))

    @property
    def has_limits(self) -> bool:
        """Whether the call that made the channel told what it will measure."""
        return self.measurement == _MICROPHONE or {"AI_MIN", "AI_MAX"} <= self.attributes.keys()

    @property
    def limits_electrical(self) -> Range:
        """`limits` in the electrical quantity."""
        low, high = self.limits
        if self.scale is not None:
            low, high = sorted((self.scale.inverse(low), self.scale.inverse(high)))
        ends = sorted((low / self.unit_per_electrical, high / self.unit_per_electrical))
        return ends[0], ends[1]

    @property
    def volts_per_electrical(self) -> float:
        """Volts at the terminals per unit of the electrical quantity."""
        return float(self.attributes["AI_EXCIT_VAL"]) if self.measurement in _EXCITED else 1.0

    @property
    def ranges(self) -> tuple[Range, ...]:
        """The product's ranges for this measurement, narrowest first; empty where none is known."""
        return self.product.ranges.get(self.quantity, ())

    @property
    def input_range(self) -> Range:
        """Smallest range of the module that holds what was asked for; −200077 if none does.

        In the quantity of the product's ranges: volts, amperes, ohms, volts per volt, coulombs.
        """
        low, high = (limit * self.volts_per_electrical for limit in self.limits_electrical)
        low = min(low, float(self.attributes.get("AI_RNG_LOW", low)))
        high = max(high, float(self.attributes.get("AI_RNG_HIGH", high)))
        ranges = self.ranges
        if not ranges:
            return (low, high) if low < high else (low - 1.0, low + 1.0)
        with contextlib.suppress(ValueError):
            return catalogue.coerce_range_of(ranges, low, high)
        raise self._outside(ranges[-1], low, high)

    def _outside(self, widest: Range, low: float, high: float) -> DaqmxError:
        """−200077 for the end of the range, or of what is to be measured, that the module does not reach."""
        end = "High" if high > widest[1] else "Low"
        set_to = self.attributes.get(f"AI_RNG_{end.upper()}")
        if set_to is not None and set_to == (high if end == "High" else low):
            name, asked, per_volt = f"AI_Rng_{end}", set_to, 1.0
        else:
            name = "AI_Max" if end == "High" else "AI_Min"
            asked = self.attributes.get(name.upper())
            per_volt = 1.0 if self.scale else self.unit_per_electrical / self.volts_per_electrical
        return DaqmxError(
            Code.INVALID_VALUE,
            f"Property: DAQmx_{name}\nRequested Value: {asked}\n"
            f"Maximum Value: {widest[1] * per_volt}\nMinimum Value: {widest[0] * per_volt}",
            f"Channel Name: {self.name}",
        )

    @property
    def converter(self) -> Converter:
        """The converter in the electrical quantity of the signal source."""
        low, high = self.input_range
        scale = 1.0 / self.volts_per_electrical
        return Converter(low * scale, high * scale, self.product.bits)

    def verify(self) -> None:
        """Raise what NI-DAQmx raises for values that the module cannot do."""
        low, high = self.limits
        if low >= high:
            raise DaqmxError(Code.MIN_NOT_BELOW_MAX, f"Channel Name: {self.name}")
        configs = self.product.terminals
        wanted = self.terminal_config
        possible = [name for name, numbers in configs.items() if self.number in numbers or self.number < 0]
        if wanted not in possible:
            raise self.refuse(
                "DAQmx_AI_TermCfg", f"DAQmx_Val_{wanted}", [f"DAQmx_Val_{name}" for name in possible]
            )
        currents = (0.0, *self.product.iepe_currents_a)
        if (
            self.measurement == "ACCELERATION_ACCELEROMETER_CURRENT_INPUT"
            and self.attributes.get("AI_EXCIT_SRC") == ExcitationSource.INTERNAL.value
            and not any(abs(self.attributes["AI_EXCIT_VAL"] - current) < 1e-9 for current in currents)
        ):
            raise self.refuse("DAQmx_AI_Excit_Val", self.attributes["AI_EXCIT_VAL"], list(currents))
        _ = self.input_range


_MICROPHONE: Final = "SOUND_PRESSURE_MICROPHONE"
_HEARING_THRESHOLD_PA: Final = 20e-6
"""Sound pressure of 0 dB: NI's argument `max_snd_press_level` is in decibels above it."""
_FROM_TEDS: Final = TEDSUnits.FROM_TEDS.value
FROM_CUSTOM_SCALE: Final = VoltageUnits.FROM_CUSTOM_SCALE.value

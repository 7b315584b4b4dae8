"""Standard templates of IEEE 1451.4: which channel attributes a sensor's data sheet gives.

Read here are fields that NI-DAQmx takes over: sensitivities, bridge, units, constants of thermocouples, RTDs
and thermistors. Widths and scalings of templates 25, 27, 30 to 33 and 36 to 38 are those with which sample
files of NI give the values that NI's tests expect; other values of the same fields are not confirmed, and
fields that are passed over are not checked. The template of strain gauges (35) is not read.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from nidaqmx.constants import (
    AccelSensitivityUnits,
    BridgeConfiguration,
    ForceIEPESensorSensitivityUnits,
    RTDType,
    ThermocoupleType,
)

from sim_hardware.daqmx_server.channels.measurements import G
from sim_hardware.daqmx_server.channels.teds import Bits, DataSheet

_UNITS: Final = {0: "Kelvin", 1: "DegC", 2: "strain", 3: "microstrain", 4: "Newtons", 5: "forcelb", 6: "kgf"}
"""Physical measurand → unit, for those whose number the standard's list begins with."""
_BRIDGES: Final = (
    BridgeConfiguration.QUARTER_BRIDGE,
    BridgeConfiguration.HALF_BRIDGE,
    BridgeConfiguration.FULL_BRIDGE,
)
_THERMOCOUPLES: Final = (
    ThermocoupleType.B,
    ThermocoupleType.E,
    ThermocoupleType.J,
    ThermocoupleType.K,
    ThermocoupleType.N,
    ThermocoupleType.R,
    ThermocoupleType.S,
    ThermocoupleType.T,
)
_RTD_CURVES: Final = (
    (3.81e-3, -6.02e-7, -6.0e-12),
    (3.9083e-3, -5.775e-7, -4.183e-12),
    (3.9692e-3, -5.8495e-7, -4.233e-12),
    (3.9739e-3, -5.870e-7, -4.4e-12),
    (3.9787e-3, -5.8686e-7, -4.167e-12),
    (3.9888e-3, -5.915e-7, -3.85e-12),
)
"""Callendar–Van Dusen A, B, C of α = 3.750, 3.851, 3.911, 3.916, 3.920 and 3.928 × 10⁻³ 1/K."""
_FORCE: Final = 1


def _iepe(fields: Bits) -> dict[str, Any]:
    """Template 25: accelerometers and force sensors with constant current."""
    kind = fields.take(1)
    fields.take(1)  # whether transfer function and mass follow
    sensitivity = fields.take_relative(16, 5e-7, 0.00015)
    if kind == _FORCE:
        unit = ForceIEPESensorSensitivityUnits.MILLIVOLTS_PER_NEWTON
        return {
            "AI_FORCE_IEPE_SENSOR_SENSITIVITY": 1e3 * sensitivity,
            "AI_FORCE_IEPE_SENSOR_SENSITIVITY_UNITS": unit.value,
        }
    return {
        "AI_ACCEL_SENSITIVITY": G * sensitivity,
        "AI_ACCEL_SENSITIVITY_UNITS": AccelSensitivityUnits.VOLTS_PER_G.value,
    }


def _microphone(fields: Bits) -> dict[str, Any]:
    """Template 27: microphones with a preamplifier of their own."""
    fields.take(1)  # whether a transfer function follows
    return {"AI_MICROPHONE_SENSITIVITY": 1e3 * fields.take_relative(16, 1e-5, 0.0001)}


def _units(fields: Bits) -> dict[str, Any]:
    """Templates 30 to 32 (voltage, current and resistance out): the physical unit."""
    return {"AI_TEDS_UNITS": _UNITS.get(fields.take(6), "")}


def _bridge(fields: Bits) -> dict[str, Any]:
    """Template 33: full-scale values in single precision, then kind and impedance of the bridge."""
    out = _units(fields)
    fields.take(2 * 32)  # physical range
    precise = fields.take(2)
    fields.take(2 * {0: 11, 1: 19, 2: 32}.get(precise, 32))  # electrical range
    out["AI_BRIDGE_CFG"] = _BRIDGES[min(fields.take(2), 2)].value
    out["AI_BRIDGE_NOM_RESISTANCE"] = fields.take_linear(18, 1.0, 0.1)
    out["AI_EXCIT_USE_FOR_SCALING"] = True
    return out


def _thermocouple(fields: Bits) -> dict[str, Any]:
    """Template 36."""
    fields.take(2 * 11 + 2 * 7)  # temperature and voltage ranges
    return {"AI_THRMCPL_TYPE": _THERMOCOUPLES[fields.take(4) % len(_THERMOCOUPLES)].value}


def _rtd(fields: Bits) -> dict[str, Any]:
    """Template 37: the curve is taken over as coefficients of a custom type."""
    fields.take(2 * 11 + 2 * 7 + 20)  # temperature and resistance ranges, resistance at 0 °C
    a, b, c = _RTD_CURVES[min(fields.take(3), len(_RTD_CURVES) - 1)]
    return {"AI_RTD_TYPE": RTDType.CUSTOM.value, "AI_RTD_A": a, "AI_RTD_B": b, "AI_RTD_C": c}


def _thermistor(fields: Bits) -> dict[str, Any]:
    """Template 38: Steinhart–Hart coefficients."""
    fields.take(2 * 11 + 2 * 18 + 20)  # temperature and resistance ranges, resistance at 25 °C
    return {name: fields.take_float() for name in ("AI_THRMSTR_A", "AI_THRMSTR_B", "AI_THRMSTR_C")}


_TEMPLATES: Final[dict[int, Callable[[Bits], dict[str, Any]]]] = {
    25: _iepe,
    27: _microphone,
    30: _units,
    31: _units,
    32: _units,
    33: _bridge,
    36: _thermocouple,
    37: _rtd,
    38: _thermistor,
}


def attributes_from(sheet: DataSheet) -> dict[str, Any]:
    """Channel attributes of a data sheet; none for a template that is not read here (strain gauges)."""
    read = _TEMPLATES.get(sheet.template)
    return {} if read is None else read(Bits(sheet.fields))

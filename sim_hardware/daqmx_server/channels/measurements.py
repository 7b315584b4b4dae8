"""What products can measure, in NI's names, and how each measurement turns volts into its unit."""

from __future__ import annotations

import math
from typing import Final

from nidaqmx import constants

from daq_app.config.hardware.products import Product

G: Final = 9.80665
INCH_M: Final = 0.0254
_POUND_N: Final = 4.4482216152605

_BRIDGE: Final = ("BRIDGE", "FORCE_BRIDGE", "PRESSURE_BRIDGE", "TORQUE_BRIDGE")
_IEPE: Final = ("VELOCITY_IEPE_SENSOR", "FORCE_IEPE_SENSOR", "SOUND_PRESSURE_MICROPHONE")
_TEMPERATURES: Final = ("TEMPERATURE_THERMOCOUPLE", "TEMPERATURE_THERMISTOR", "TEMPERATURE_RTD")
_USAGES: Final[dict[str, tuple[str, ...]]] = {
    "voltage": ("VOLTAGE", "VOLTAGE_CUSTOM_WITH_EXCITATION"),
    "voltage_excitation": ("VOLTAGE_CUSTOM_WITH_EXCITATION",),
    "current": ("CURRENT",),
    "rms": ("VOLTAGE_ACRMS", "CURRENT_ACRMS"),
    "mio": (
        "CURRENT",
        "FREQUENCY_VOLTAGE",
        "RESISTANCE",
        *_TEMPERATURES,
        "TEMPERATURE_BUILT_IN_SENSOR",
        "STRAIN_STRAIN_GAGE",
        "CALCULATED_POWER",
    ),
    "dmm": ("RESISTANCE",),
    "resistance": ("RESISTANCE", "TEMPERATURE_THERMISTOR"),
    "rtd": ("TEMPERATURE_RTD",),
    "rtd_cjc": ("TEMPERATURE_RTD", "TEMPERATURE_THERMISTOR"),
    "thermocouple": ("TEMPERATURE_THERMOCOUPLE",),
    "built_in_temperature": ("TEMPERATURE_BUILT_IN_SENSOR",),
    "bridge": _BRIDGE,
    "force": ("FORCE_BRIDGE",),
    "pressure": ("PRESSURE_BRIDGE",),
    "torque": ("TORQUE_BRIDGE",),
    "strain": ("STRAIN_STRAIN_GAGE",),
    "rosette": ("ROSETTE_STRAIN_GAGE",),
    "iepe": ("ACCELERATION_ACCELEROMETER_CURRENT_INPUT", *_IEPE),
    "microphone": ("SOUND_PRESSURE_MICROPHONE",),
    "velocity": ("VELOCITY_IEPE_SENSOR",),
    "force_iepe": ("FORCE_IEPE_SENSOR",),
    "charge": ("CHARGE", "ACCELERATION_CHARGE"),
    "accel_4wire": ("ACCELERATION_4_WIRE_DC_VOLTAGE",),
    "lvdt_native": ("POSITION_LINEAR_LVDT", "POSITION_ANGULAR_RVDT"),
    "eddy_current": ("POSITION_EDDY_CURRENT_PROX_PROBE",),
    "power": ("POWER",),
    "calculated_power": ("CALCULATED_POWER",),
}


def measurements_of(product: Product) -> list[str]:
    """Names in `UsageTypeAI` of what a product can measure here."""
    names = (name for known in sorted(product.measurements) for name in _USAGES.get(known, ()))
    return list(dict.fromkeys(names))


QUANTITIES: Final[dict[str, str]] = {
    "CURRENT": "current",
    "CURRENT_ACRMS": "current",
    "RESISTANCE": "resistance",
    "BRIDGE": "bridge",
    "CHARGE": "charge",
    "ACCELERATION_CHARGE": "charge",
    "VOLTAGE": "voltage",
    "VOLTAGE_ACRMS": "voltage",
    "VOLTAGE_CUSTOM_WITH_EXCITATION": "voltage",
    "ACCELERATION_ACCELEROMETER_CURRENT_INPUT": "voltage",
    "ACCELERATION_4_WIRE_DC_VOLTAGE": "voltage",
    "VELOCITY_IEPE_SENSOR": "voltage",
    "FORCE_IEPE_SENSOR": "voltage",
    "SOUND_PRESSURE_MICROPHONE": "voltage",
    "POSITION_LINEAR_LVDT": "voltage",
    "POSITION_ANGULAR_RVDT": "voltage",
    "POSITION_EDDY_CURRENT_PROX_PROBE": "voltage",
}
"""Electrical quantity of a measurement that is proportional to it; the others are simulated in their unit."""

UNITS_PER_SI: Final[dict[int, float]] = {
    constants.VoltageUnits.VOLTS.value: 1.0,
    constants.CurrentUnits.AMPS.value: 1.0,
    constants.ResistanceUnits.OHMS.value: 1.0,
    constants.AccelUnits.G.value: 1.0 / G,
    constants.AccelUnits.METERS_PER_SECOND_SQUARED.value: 1.0,
    constants.AccelUnits.INCHES_PER_SECOND_SQUARED.value: 1.0 / INCH_M,
    constants.LengthUnits.METERS.value: 1.0,
    constants.LengthUnits.INCHES.value: 1.0 / INCH_M,
    constants.AngleUnits.DEGREES.value: 180.0 / math.pi,
    constants.AngleUnits.RADIANS.value: 1.0,
    constants.VelocityUnits.METERS_PER_SECOND.value: 1.0,
    constants.VelocityUnits.INCHES_PER_SECOND.value: 1.0 / INCH_M,
    constants.ForceUnits.NEWTONS.value: 1.0,
    constants.ForceUnits.POUNDS.value: 1.0 / _POUND_N,
    constants.ForceUnits.KILOGRAM_FORCE.value: 1.0 / G,
    constants.BridgeUnits.VOLTS_PER_VOLT.value: 1.0,
    constants.BridgeUnits.MILLIVOLTS_PER_VOLT.value: 1e3,
    constants.ChargeUnits.COULOMBS.value: 1.0,
    constants.ChargeUnits.PICO_COULOMBS.value: 1e12,
    constants.SoundPressureUnits.PA.value: 1.0,
}
"""Reading per unit of the SI quantity."""

_MIL_M: Final = 1e-3 * INCH_M
SI_PER_SENSITIVITY: Final[dict[int, float]] = {
    constants.AccelSensitivityUnits.MILLIVOLTS_PER_G.value: 1e-3 / G,
    constants.AccelSensitivityUnits.VOLTS_PER_G.value: 1.0 / G,
    constants.AccelChargeSensitivityUnits.PICO_COULOMBS_PER_G.value: 1e-12 / G,
    constants.AccelChargeSensitivityUnits.PICO_COULOMBS_PER_METERS_PER_SECOND_SQUARED.value: 1e-12,
    constants.AccelChargeSensitivityUnits.PICO_COULOMBS_PER_INCHES_PER_SECOND_SQUARED.value: 1e-12 / INCH_M,
    constants.LVDTSensitivityUnits.MILLIVOLTS_PER_VOLT_PER_MILLIMETER.value: 1.0,
    constants.LVDTSensitivityUnits.MILLIVOLTS_PER_VOLT_PER_MILLI_INCH.value: 1.0 / INCH_M,
    constants.RVDTSensitivityUnits.MILLIVOLTS_PER_VOLT_PER_DEGREE.value: 1e-3 * 180.0 / math.pi,
    constants.RVDTSensitivityUnits.MILLIVOLTS_PER_VOLT_PER_RADIAN.value: 1e-3,
    constants.VelocityIEPESensorSensitivityUnits.MILLIVOLTS_PER_MILLIMETER_PER_SECOND.value: 1.0,
    constants.VelocityIEPESensorSensitivityUnits.MILLIVOLTS_PER_INCH_PER_SECOND.value: 1e-3 / INCH_M,
    constants.ForceIEPESensorSensitivityUnits.MILLIVOLTS_PER_NEWTON.value: 1e-3,
    constants.ForceIEPESensorSensitivityUnits.MILLIVOLTS_PER_POUND.value: 1e-3 / _POUND_N,
    constants.EddyCurrentProxProbeSensitivityUnits.MILLIVOLTS_PER_MIL.value: 1e-3 / _MIL_M,
    constants.EddyCurrentProxProbeSensitivityUnits.VOLTS_PER_MIL.value: 1.0 / _MIL_M,
    constants.EddyCurrentProxProbeSensitivityUnits.MILLIVOLTS_PER_MILLIMETER.value: 1.0,
    constants.EddyCurrentProxProbeSensitivityUnits.VOLTS_PER_MILLIMETER.value: 1e3,
    constants.EddyCurrentProxProbeSensitivityUnits.MILLIVOLTS_PER_MICRON.value: 1e3,
}
"""Electrical quantity per SI unit, for a sensitivity of one."""

UNIT_NAMES: Final[dict[int, str]] = {
    constants.VoltageUnits.VOLTS.value: "Volts",
    constants.CurrentUnits.AMPS.value: "Amps",
    constants.ResistanceUnits.OHMS.value: "Ohms",
    constants.AccelUnits.G.value: "g",
    constants.AccelUnits.METERS_PER_SECOND_SQUARED.value: "m/s^2",
    constants.AccelUnits.INCHES_PER_SECOND_SQUARED.value: "in/s^2",
    constants.LengthUnits.METERS.value: "Meters",
    constants.LengthUnits.INCHES.value: "Inches",
    constants.TemperatureUnits.DEG_C.value: "DegC",
    constants.TemperatureUnits.DEG_F.value: "DegF",
    constants.TemperatureUnits.K.value: "Kelvin",
    constants.TemperatureUnits.DEG_R.value: "DegR",
    constants.StrainUnits.STRAIN.value: "Strain",
    constants.FrequencyUnits.HZ.value: "Hz",
    constants.SoundPressureUnits.PA.value: "Pascals",
    constants.BridgeUnits.VOLTS_PER_VOLT.value: "V/V",
    constants.BridgeUnits.MILLIVOLTS_PER_VOLT.value: "mV/V",
    constants.ForceUnits.NEWTONS.value: "Newtons",
    constants.AngleUnits.DEGREES.value: "Degrees",
    constants.AngleUnits.RADIANS.value: "Radians",
}

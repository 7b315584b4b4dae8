"""Sensitivity units that a rig file may use, and their factor to SI.

A sensitivity says how many units of *reading* (what the NI channel returns) one unit of the
measured quantity gives.  Inside the program every measured quantity is SI: metres for LVDTs and
wire potentiometers, m/s² for accelerometers, radians for tiltmeters; auxiliary families have units of
their own (daq_app.config.families), degrees Celsius among them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from daq_app.config.families import AUXILIARY

G_M_S2: Final = 9.80665
"""Standard gravity (ISO 80000-3), the g of accelerometer certificates."""

SENSITIVITY_TO_SI: Final[dict[str, tuple[str, float]]] = {
    "V/mm": ("m", 1e3),
    "mV/mm": ("m", 1.0),
    "V/m": ("m", 1.0),
    "mV/V/mm": ("m", 1.0),  # volts per volt of excitation per metre
    "V/g": ("m/s2", 1.0 / G_M_S2),
    "mV/g": ("m/s2", 1e-3 / G_M_S2),
    "V/(m/s2)": ("m/s2", 1.0),
    "V/deg": ("rad", 180.0 / math.pi),
    "mV/deg": ("rad", 0.180 / math.pi),
    "V/rad": ("rad", 1.0),
}
"""unit → (SI unit of the measured quantity, factor that turns the value into reading per SI unit)."""

FAMILY_SI_UNIT: Final[dict[str, str]] = {
    "lvdt": "m",
    "wire": "m",
    "accelerometer": "m/s2",
    "tiltmeter": "rad",
    **{name: family.si_unit for name, family in AUXILIARY.items()},
}
"""Sensor family → SI unit of what it measures."""

READING_UNIT: Final[Mapping[str, str]] = {
    "voltage": "V",
    "iepe": "m/s2",
    "lvdt_native": "m",
    "current": "A",
    "bridge": "V/V",
    "thermocouple": "degC",
}
"""Measurement → unit of what the NI channel returns."""

_READINGS: Final[Mapping[str, Mapping[str, float]]] = {
    "voltage": {"V": 1.0, "mV": 1e-3},
    "current": {"A": 1.0, "mA": 1e-3},
    "bridge": {"V/V": 1.0, "mV/V": 1e-3},
}
_MULTIPLES: Final[Mapping[str, Mapping[str, float]]] = {
    "m": {"m": 1.0, "mm": 1e-3},
    "N": {"N": 1.0, "kN": 1e3},
    "m/m": {"(m/m)": 1.0, "(mm/m)": 1e-3, "(um/m)": 1e-6},
    "m/s2": {"(m/s2)": 1.0, "g": G_M_S2},
    "rad": {"rad": 1.0, "deg": math.pi / 180.0},
}


def sensitivity_units(measurement: str, si_unit: str) -> dict[str, float]:
    """Units that a sensitivity may have → factor to reading per unit of the quantity.

    A quantity whose multiples are not known is written as it is: ``mV/degC``, ``V/(N m)``.
    """
    if measurement == "thermocouple":
        return {"1": 1.0}
    if measurement == "lvdt_native":
        return {"mV/V/mm": SENSITIVITY_TO_SI["mV/V/mm"][1]}
    known = {name: factor for name, (of, factor) in SENSITIVITY_TO_SI.items() if of == si_unit}
    known.pop("mV/V/mm", None)
    if known and measurement in ("voltage", "iepe"):
        return known
    written = si_unit if si_unit.isalpha() else f"({si_unit})"
    multiples = _MULTIPLES.get(si_unit, {written: 1.0})
    readings = _READINGS.get(measurement, {})
    return {f"{r}/{m}": a / b for m, b in multiples.items() for r, a in readings.items()}

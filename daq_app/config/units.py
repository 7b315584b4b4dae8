"""Sensitivity units that a rig file may use, and their factor to SI.

A sensitivity says how many units of *reading* (what the NI channel returns) one unit of the
measured quantity gives.  Inside the program every measured quantity is SI: metres for LVDTs and
wire potentiometers, m/s² for accelerometers, radians for tiltmeters.
"""

from __future__ import annotations

import math
from typing import Final

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
}
"""Sensor family → SI unit of what it measures."""

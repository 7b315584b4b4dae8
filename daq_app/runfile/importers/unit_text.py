"""Units as people and programs write them."""

from __future__ import annotations

import math
from typing import Final

from daq_app.config.units import G_M_S2

_FACTORS: Final[dict[str, tuple[str, float]]] = {
    "m": ("m", 1.0),
    "mm": ("m", 1e-3),
    "cm": ("m", 1e-2),
    "µm": ("m", 1e-6),
    "um": ("m", 1e-6),
    "metres": ("m", 1.0),
    "meters": ("m", 1.0),
    "millimetres": ("m", 1e-3),
    "millimeters": ("m", 1e-3),
    "rad": ("rad", 1.0),
    "mrad": ("rad", 1e-3),
    "deg": ("rad", math.pi / 180),
    "degrees": ("rad", math.pi / 180),
    "°": ("rad", math.pi / 180),
    "m/s2": ("m/s2", 1.0),
    "m/s/s": ("m/s2", 1.0),
    "mm/s2": ("m/s2", 1e-3),
    "g": ("m/s2", G_M_S2),
    "gn": ("m/s2", G_M_S2),
    "mg": ("m/s2", 1e-3 * G_M_S2),
    "v": ("V", 1.0),
    "volt": ("V", 1.0),
    "volts": ("V", 1.0),
    "mv": ("V", 1e-3),
}
_TIME_UNITS: Final = frozenset({"s", "ms", "sec", "seconds", "second"})


def parse_unit(text: str) -> tuple[str, float] | None:
    """(unit of this program: m, rad, m/s2 or V; factor to it), or None for a unit of something else."""
    key = text.strip().strip("[]()").replace("²", "2").replace("^", "").replace("**", "").replace(" ", "")
    key = key.replace("μ", "µ")  # Greek mu to the micro sign
    return _FACTORS.get(key.casefold()) or _FACTORS.get(key)


def is_time(text: str) -> bool:
    """Whether a unit is one of time: no channel of a rig measures time, so it is a label gone wrong."""
    return text.strip().casefold() in _TIME_UNITS

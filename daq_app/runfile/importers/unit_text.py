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
    "a": ("A", 1.0),
    "ma": ("A", 1e-3),
    "v/v": ("V/V", 1.0),
    "mv/v": ("V/V", 1e-3),
    "N": ("N", 1.0),
    "kN": ("N", 1e3),
    "MN": ("N", 1e6),
    "m/m": ("m/m", 1.0),
    "mm/m": ("m/m", 1e-3),
    "µm/m": ("m/m", 1e-6),
    "um/m": ("m/m", 1e-6),
    "strain": ("m/m", 1.0),
    "microstrain": ("m/m", 1e-6),
    "µε": ("m/m", 1e-6),
    "degC": ("degC", 1.0),
    "celsius": ("degC", 1.0),
    "°C": ("degC", 1.0),
}
_FOLDED: Final = {name.casefold(): unit for name, unit in _FACTORS.items() if name.casefold() not in ("mn",)}
"""Names in small letters; mn may be mN or MN, and stays unknown."""
_TIME_UNITS: Final = frozenset({"s", "ms", "sec", "seconds", "second"})


def parse_unit(text: str) -> tuple[str, float] | None:
    """(unit of this program; factor to it), or None for a unit of something that it does not measure.

    Units of this program: m, rad, m/s2, N, m/m, degC, V, A, V/V.
    """
    key = text.strip().strip("[]()").replace("²", "2").replace("^", "").replace("**", "").replace(" ", "")
    key = key.replace("μ", "µ")  # Greek mu to the micro sign
    return _FACTORS.get(key) or _FACTORS.get(key.casefold()) or _FOLDED.get(key.casefold())


def is_time(text: str) -> bool:
    """Whether a unit is one of time: no channel of a rig measures time, so it is a label gone wrong."""
    return text.strip().casefold() in _TIME_UNITS

"""Custom scales: readings in units of the user's own."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from nidaqmx.constants import ScaleType
from numpy.typing import NDArray

Values = NDArray[np.float64]

LINEAR: Final[int] = ScaleType.LINEAR.value
MAP: Final[int] = ScaleType.MAP_RANGES.value
POLYNOMIAL: Final[int] = ScaleType.POLYNOMIAL.value
TABLE: Final[int] = ScaleType.TABLE.value


@dataclass(slots=True)
class CustomScale:
    """One scale; `attributes` as NI names them, without ``SCALE_ATTRIBUTE_``."""

    attributes: dict[str, Any] = field(default_factory=dict)

    @property
    def pre_scaled_units(self) -> int:
        return int(self.attributes["PRE_SCALED_UNITS"])

    @property
    def scaled_units(self) -> str:
        return str(self.attributes["SCALED_UNITS"])

    def forward(self, values: Values) -> Values:
        """Pre-scaled values → scaled ones; a table clips at its ends."""
        a = self.attributes
        kind = a["TYPE"]
        if kind == POLYNOMIAL:
            return np.asarray(np.polynomial.polynomial.polyval(values, a["POLY_FORWARD_COEFF"]))
        if kind == TABLE:
            return np.asarray(np.interp(values, a["TABLE_PRE_SCALED_VALS"], a["TABLE_SCALED_VALS"]))
        slope, intercept = self._line()
        return slope * values + intercept

    def inverse(self, value: float) -> float:
        """Scaled value → pre-scaled one."""
        a = self.attributes
        kind = a["TYPE"]
        if kind == POLYNOMIAL:
            return float(np.polynomial.polynomial.polyval(value, a["POLY_REVERSE_COEFF"]))
        if kind == TABLE:
            return float(np.interp(value, a["TABLE_SCALED_VALS"], a["TABLE_PRE_SCALED_VALS"]))
        slope, intercept = self._line()
        return (value - intercept) / slope

    def _line(self) -> tuple[float, float]:
        a = self.attributes
        if a["TYPE"] == LINEAR:
            return float(a["LIN_SLOPE"]), float(a["LIN_Y_INTERCEPT"])
        low, high = a["MAP_PRE_SCALED_MIN"], a["MAP_PRE_SCALED_MAX"]
        slope = (a["MAP_SCALED_MAX"] - a["MAP_SCALED_MIN"]) / (high - low)
        return slope, a["MAP_SCALED_MIN"] - slope * low

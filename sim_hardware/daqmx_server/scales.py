"""Custom scales: readings in units of the user's own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from nidaqmx._stubs import nidaqmx_pb2 as pb
from nidaqmx.constants import ScaleType
from numpy.typing import NDArray

from sim_hardware.daqmx_server.attributes import Handler, unsupported
from sim_hardware.daqmx_server.bench import Bench
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.requests import fields_of

Values = NDArray[np.float64]

_LINEAR: Final[int] = ScaleType.LINEAR.value
_MAP: Final[int] = ScaleType.MAP_RANGES.value
_POLYNOMIAL: Final[int] = ScaleType.POLYNOMIAL.value
_TABLE: Final[int] = ScaleType.TABLE.value


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
        if kind == _POLYNOMIAL:
            return np.asarray(np.polynomial.polynomial.polyval(values, a["POLY_FORWARD_COEFF"]))
        if kind == _TABLE:
            return np.asarray(np.interp(values, a["TABLE_PRE_SCALED_VALS"], a["TABLE_SCALED_VALS"]))
        slope, intercept = self._line()
        return slope * values + intercept

    def inverse(self, value: float) -> float:
        """Scaled value → pre-scaled one."""
        a = self.attributes
        kind = a["TYPE"]
        if kind == _POLYNOMIAL:
            return float(np.polynomial.polynomial.polyval(value, a["POLY_REVERSE_COEFF"]))
        if kind == _TABLE:
            return float(np.interp(value, a["TABLE_SCALED_VALS"], a["TABLE_PRE_SCALED_VALS"]))
        slope, intercept = self._line()
        return (value - intercept) / slope

    def _line(self) -> tuple[float, float]:
        a = self.attributes
        if a["TYPE"] == _LINEAR:
            return float(a["LIN_SLOPE"]), float(a["LIN_Y_INTERCEPT"])
        low, high = a["MAP_PRE_SCALED_MIN"], a["MAP_PRE_SCALED_MAX"]
        slope = (a["MAP_SCALED_MAX"] - a["MAP_SCALED_MIN"]) / (high - low)
        return slope, a["MAP_SCALED_MIN"] - slope * low


_CREATE: Final[dict[str, tuple[int, dict[str, str]]]] = {
    "CreateLinScale": (_LINEAR, {"slope": "LIN_SLOPE", "y_intercept": "LIN_Y_INTERCEPT"}),
    "CreateMapScale": (
        _MAP,
        {
            "prescaled_min": "MAP_PRE_SCALED_MIN",
            "prescaled_max": "MAP_PRE_SCALED_MAX",
            "scaled_min": "MAP_SCALED_MIN",
            "scaled_max": "MAP_SCALED_MAX",
        },
    ),
    "CreatePolynomialScale": (
        _POLYNOMIAL,
        {"forward_coeffs": "POLY_FORWARD_COEFF", "reverse_coeffs": "POLY_REVERSE_COEFF"},
    ),
    "CreateTableScale": (
        _TABLE,
        {"prescaled_vals": "TABLE_PRE_SCALED_VALS", "scaled_vals": "TABLE_SCALED_VALS"},
    ),
}


def _create_handler(rpc: str) -> Handler:
    kind, names = _CREATE[rpc]
    reply = getattr(pb, f"{rpc}Response")

    def create(bench: Bench, request: Any) -> Any:
        fields = fields_of(request)
        attributes: dict[str, Any] = {
            "TYPE": kind,
            "DESCR": "",
            "PRE_SCALED_UNITS": fields["pre_scaled_units"],
            "SCALED_UNITS": fields["scaled_units"],
        }
        for name, attribute in names.items():
            value = fields[name]
            attributes[attribute] = value if isinstance(value, float) else list(value)
        _check(attributes)
        bench.scales[fields["name"]] = CustomScale(attributes)
        return reply()

    return create


def _check(attributes: dict[str, Any]) -> None:
    """Raise what NI-DAQmx raises for a scale that cannot be turned round."""
    kind = attributes["TYPE"]
    if kind == _LINEAR and attributes["LIN_SLOPE"] == 0:
        raise DaqmxError(Code.SCALE_ZERO_SLOPE)
    if kind == _MAP and attributes["MAP_PRE_SCALED_MIN"] == attributes["MAP_PRE_SCALED_MAX"]:
        raise DaqmxError(Code.SCALE_PRE_SCALED_EQUAL)
    if kind == _MAP and attributes["MAP_SCALED_MIN"] == attributes["MAP_SCALED_MAX"]:
        raise DaqmxError(Code.SCALE_SCALED_EQUAL)
    if kind == _POLYNOMIAL and not (attributes["POLY_FORWARD_COEFF"] and attributes["POLY_REVERSE_COEFF"]):
        raise DaqmxError(Code.SCALE_NO_COEFFICIENTS)
    if kind == _TABLE:
        given, made = attributes["TABLE_PRE_SCALED_VALS"], attributes["TABLE_SCALED_VALS"]
        if len(given) != len(made):
            raise DaqmxError(Code.SCALE_TABLE_LENGTHS)
        order = np.argsort(given)
        attributes["TABLE_PRE_SCALED_VALS"] = [given[i] for i in order]
        attributes["TABLE_SCALED_VALS"] = [made[i] for i in order]


class ScaleGroup:
    """Attributes of custom scales."""

    def get(self, bench: Bench, request: Any, name: str) -> Any:
        attributes = find_scale(bench, request.scale_name).attributes
        if name not in attributes:
            raise unsupported(f"Scale_{name}")
        return attributes[name]

    def set(self, bench: Bench, request: Any, name: str, value: Any) -> None:
        scale = find_scale(bench, request.scale_name)
        if name not in scale.attributes or name == "TYPE":
            raise unsupported(f"Scale_{name}")
        changed = scale.attributes | {name: value}
        _check(changed)
        scale.attributes.update(changed)

    def reset(self, bench: Bench, request: Any, name: str) -> None:
        raise unsupported(f"Scale_{name}")


def find_scale(bench: Bench, name: str) -> CustomScale:
    """−200378 for a name that no scale has."""
    try:
        return bench.scales[name]
    except KeyError:
        raise DaqmxError(Code.SCALE_UNKNOWN, f"Custom Scale Name: {name}") from None


def reverse_coefficients(bench: Bench, request: Any) -> Any:
    """CalculateReversePolyCoeff: the polynomial that undoes another one best over a range."""
    order = request.reverse_poly_order
    if order < 0:
        order = len(request.forward_coeffs) - 1
    x = np.linspace(request.min_val_x, request.max_val_x, max(request.num_points_to_compute, order + 1))
    y = np.polynomial.polynomial.polyval(x, list(request.forward_coeffs))
    fitted = np.polynomial.Polynomial.fit(y, x, order).convert().coef
    return pb.CalculateReversePolyCoeffResponse(reverse_coeffs=fitted.tolist())


def scale_handlers() -> dict[str, Callable[[Bench, Any], Any]]:
    """RPC name → handler."""
    handlers: dict[str, Handler] = {rpc: _create_handler(rpc) for rpc in _CREATE}
    return handlers | {"CalculateReversePolyCoeff": reverse_coefficients}

"""Calls that create, read and change custom scales."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from nidaqmx._stubs import nidaqmx_pb2 as pb

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels.scale import LINEAR, MAP, POLYNOMIAL, TABLE, CustomScale
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.requests import fields_of
from sim_hardware.daqmx_server.services.attributes.groups import Handler, unsupported

_CREATE: Final[dict[str, tuple[int, dict[str, str]]]] = {
    "CreateLinScale": (LINEAR, {"slope": "LIN_SLOPE", "y_intercept": "LIN_Y_INTERCEPT"}),
    "CreateMapScale": (
        MAP,
        {
            "prescaled_min": "MAP_PRE_SCALED_MIN",
            "prescaled_max": "MAP_PRE_SCALED_MAX",
            "scaled_min": "MAP_SCALED_MIN",
            "scaled_max": "MAP_SCALED_MAX",
        },
    ),
    "CreatePolynomialScale": (
        POLYNOMIAL,
        {"forward_coeffs": "POLY_FORWARD_COEFF", "reverse_coeffs": "POLY_REVERSE_COEFF"},
    ),
    "CreateTableScale": (
        TABLE,
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
    if kind == LINEAR and attributes["LIN_SLOPE"] == 0:
        raise DaqmxError(Code.SCALE_ZERO_SLOPE)
    if kind == MAP and attributes["MAP_PRE_SCALED_MIN"] == attributes["MAP_PRE_SCALED_MAX"]:
        raise DaqmxError(Code.SCALE_PRE_SCALED_EQUAL)
    if kind == MAP and attributes["MAP_SCALED_MIN"] == attributes["MAP_SCALED_MAX"]:
        raise DaqmxError(Code.SCALE_SCALED_EQUAL)
    if kind == POLYNOMIAL and not (attributes["POLY_FORWARD_COEFF"] and attributes["POLY_REVERSE_COEFF"]):
        raise DaqmxError(Code.SCALE_NO_COEFFICIENTS)
    if kind == TABLE:
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
            raise DaqmxError(Code.SCALE_ATTRIBUTE, f"Property: DAQmx_Scale_{name}")
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

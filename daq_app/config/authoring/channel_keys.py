"""Keys of a sensor's channel on one module: what its list says, then what its family has as a rule."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any, Final

from pydantic import ValidationError

from daq_app.config.authoring.sensor import Sensor
from daq_app.config.authoring.terminals import terminal_config
from daq_app.config.checks import electrical_range_v
from daq_app.config.families import is_auxiliary
from daq_app.config.hardware import catalogue
from daq_app.config.hardware.products import Product
from daq_app.config.rig import Channel
from daq_app.config.shipped import shipped_configs
from daq_app.config.toml_file import parse_toml, read_text
from daq_app.config.units import FAMILY_SI_UNIT, sensitivity_units

_TEMPLATES: Final = ("fr2.toml", "fr1-iepe.toml", "fr1-pxie.toml")
"""Rig files that say what a family has as a voltage, on an IEPE module and on a native LVDT module."""
_DRIVEN: Final[Mapping[str, str]] = {
    "accelerometer": "iepe",
    "lvdt": "lvdt_native",
    "displacement": "lvdt_native",
    "temperature": "thermocouple",
}
"""Family → the measurement for which a laboratory has modules of their own."""
_WORDS: Final[Mapping[str, tuple[str, ...]]] = {
    "voltage": ("measurement",),
    "thermocouple": ("thermocouple",),
    "bridge": ("bridge", "bridge_ohm"),
}
"""Measurement → keys that tell it; `measurement` itself says which."""
_REACH: Final[Mapping[str, float]] = {"voltage": 10.0, "iepe": 5.0, "current": 0.02, "bridge": 0.025}
"""Largest reading (V, A, V/V) of a sensor whose list gives a sensitivity and no range. Assumed: what NI's
usual modules read."""
_NOISE_SHARE: Final = 1e-4
"""Expected noise of a sensor as a share of its range, where the list gives none and it is auxiliary or of a
family that no rig file of the program has. Assumed."""
_THERMOCOUPLE: Final[Mapping[str, Any]] = {
    "thermocouple": "K",
    "sensitivity": 1.0,
    "sensitivity_unit": "1",
    "range_si": [-40.0, 120.0],
}
"""NI-DAQmx scales to °C; type and range of a thermocouple in a laboratory's air or mortar. Assumed."""
_BRIDGE_V: Final = 5.0
"""Excitation of a bridge where the list gives none. Assumed."""
NOT_COPIED: Final = ("assumed", "certificate", "terminal_config", "input_range_v", "measurement")


def measurements_of(sensor: Sensor) -> list[str]:
    """How a sensor may be read, the likeliest first where a module for it is there.

    The list's own word decides; else what only one kind has (type of a thermocouple, circuit of a bridge) or
    what its unit of sensitivity allows; one of which nothing is known is what its family has as a rule.
    """
    for way, words in _WORDS.items():
        if any(word in sensor.keys for word in words):
            return [str(sensor.keys.get("measurement", way))]
    driven = [_DRIVEN[sensor.family]] if sensor.family in _DRIVEN else []
    unit = sensor.keys.get("sensitivity_unit")
    if unit is None:
        known = [way for way in driven if way == "thermocouple" or (sensor.family, way) in _templates()]
        return known if known == ["thermocouple"] else [*known, "voltage"]
    si_unit = FAMILY_SI_UNIT.get(sensor.family) or str(sensor.keys.get("unit", ""))
    every = [*driven, "voltage", "current", "bridge"]
    # A unit that nothing has is told by the check of the whole text.
    return [name for name in every if unit in sensitivity_units(name, si_unit)] or ["voltage"]


def channel_keys(sensor: Sensor, measurement: str, product: Product) -> tuple[dict[str, Any], list[str]]:
    """(keys of the channel without id, place and certificate, those of them that are assumed)."""
    base = dict(_base(sensor, measurement))
    given = {key: value for key, value in sensor.keys.items() if key != "certificate"}
    base.update(_excitation(measurement, product, given.pop("excitation_value", None)))
    assumed = [key for key in base if key not in given and key != "axis"]
    keys = {**base, **given}
    if "sensitivity" in given and measurement in _REACH:
        keys["offset"] = given.get("offset", 0.0)  # the usual sensor's offset is none of this one's
        if "range_si" not in given:
            keys["range_si"] = _range_of(sensor, measurement, keys)
    known = not is_auxiliary(sensor.family) and any(sensor.family == family for family, _ in _templates())
    if not known and "noise_si" not in keys and "range_si" in keys:
        keys["noise_si"] = _NOISE_SHARE * max(map(abs, keys["range_si"]))
    unsure = len(measurements_of(sensor)) > 1
    if measurement != "voltage" or (unsure and "sensitivity" in given):
        keys["measurement"] = measurement
        assumed += ["measurement"] if unsure else []
    keys["terminal_config"] = terminal_config(product)
    if measurement != "thermocouple":
        keys["input_range_v"] = list(_input_range(keys, sensor, measurement, product))
    return keys, [key for key in assumed if key in keys]


def as_channel(sensor: Sensor, keys: Mapping[str, Any], physical_channel: str) -> Channel | None:
    """The channel that those keys make; None where they make none, which a check of the text explains."""
    try:
        return Channel.model_validate(
            {
                "id": "S",
                "family": sensor.family,
                "physical_channel": physical_channel,
                "position_m": sensor.position_m,
                "certificate": {"number": "", "calibrated": "2000-01-01", "due": "2000-01-01"},
                **keys,
            }
        )
    except ValidationError:
        return None


def reading_range(channel: Channel) -> tuple[float, float] | None:
    """Smallest and largest reading (V, A, V/V) over a sensor's range; None where its unit is unknown."""
    try:
        return electrical_range_v(channel)
    except KeyError:
        return None


def certificate_of(family: str) -> Mapping[str, Any]:
    """The days of a certificate for a sensor whose list gives none."""
    templates = _templates()
    table = templates.get((family, "voltage")) or templates["lvdt", "voltage"]
    return dict(table["certificate"])


@lru_cache(maxsize=1)
def _templates() -> Mapping[tuple[str, str], Mapping[str, Any]]:
    """(family, measurement) → what the rig files that come with the program say of its channels."""
    tables: dict[tuple[str, str], Mapping[str, Any]] = {}
    for name in _TEMPLATES:
        path = shipped_configs() / name
        for family, table in parse_toml(read_text(path), str(path))["channel_defaults"].items():
            tables.setdefault((family, table.get("measurement", "voltage")), table)
    return tables


def _base(sensor: Sensor, measurement: str) -> Iterator[tuple[str, Any]]:
    templates = _templates()
    table = templates.get((sensor.family, measurement))
    if table is not None:
        yield from ((key, value) for key, value in table.items() if key not in NOT_COPIED)
    elif measurement == "thermocouple":
        yield from _THERMOCOUPLE.items()
    else:
        # A sensor that is read in another way than its family's usual one has that one's noise only.
        other = templates.get((sensor.family, "voltage"), {})
        yield from ((key, other[key]) for key in ("axis", "noise_si") if key in other)


def _excitation(measurement: str, product: Product, value: Any) -> Iterator[tuple[str, Any]]:
    low, high = product.excitation_v
    if measurement == "iepe" and product.iepe_currents_a:
        yield "excitation", {"kind": "internal_current", "value": product.iepe_currents_a[0]}
    elif measurement == "bridge":
        volts = float(value) if value is not None else min(max(_BRIDGE_V, low), high or _BRIDGE_V)
        yield "excitation", {"kind": "internal_voltage", "value": volts}
    elif measurement == "voltage" and value is not None:
        yield "excitation", {"kind": "external_voltage", "value": float(value)}


def _range_of(sensor: Sensor, measurement: str, keys: Mapping[str, Any]) -> list[float]:
    """The quantity at the ends of what a usual module reads, where the list gives a sensitivity alone."""
    si_unit = FAMILY_SI_UNIT.get(sensor.family) or str(keys.get("unit", ""))
    factors = sensitivity_units(measurement, si_unit)
    per_si = float(keys["sensitivity"]) * factors.get(str(keys.get("sensitivity_unit", "")), 1.0)
    zero = 0.0 if measurement == "iepe" else abs(float(keys["offset"]))
    reach = (_REACH[measurement] - zero) / per_si if per_si else 0.0
    return [round(-0.999 * reach, 6), round(0.999 * reach, 6)]


def _input_range(
    keys: Mapping[str, Any], sensor: Sensor, measurement: str, product: Product
) -> tuple[float, float]:
    """The module's narrowest range that holds the sensor's output; its widest where none does."""
    ranges = product.ranges.get(measurement, product.ranges_v)
    if not ranges:
        return (-_REACH["voltage"], _REACH["voltage"])
    channel = as_channel(sensor, keys, "D/ai0")
    output = reading_range(channel) if channel is not None else None
    if output is None:
        return ranges[-1]
    try:
        return catalogue.coerce_range(product, *output, measurement)
    except ValueError:
        return ranges[-1]

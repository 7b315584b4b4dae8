"""The text of a new rig file, with comments for whoever edits it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, get_args

import tomli_w

from daq_app.config.authoring.block import Block
from daq_app.config.authoring.sensor import Sensor
from daq_app.config.authoring.terminals import CHASSIS, chassis_name, modules_for, terminal_config, wire_up
from daq_app.config.families import Family, is_auxiliary
from daq_app.config.hardware import catalogue
from daq_app.config.loader import parse_rig
from daq_app.config.planning.planner import plan_tasks
from daq_app.config.shipped import shipped_configs
from daq_app.config.toml_file import parse_toml, read_text
from daq_app.config.units import FAMILY_SI_UNIT, sensitivity_units

_REACH_V: Final = 10.0
_NOISE_SHARE: Final = 1e-4
"""Expected noise of an auxiliary sensor as a share of its range, where the list gives none. Assumed."""
_WIRE_M: Final = 3.0
"""Distance of a wire's fixed end from the wall where the list gives none. Assumed."""
_HEAD: Final = """# {name}: written by `daq-app rig new`; edit it, then check it:  daq-app config check FILE
# Frame of every position: origin at the centre of the base, x through the thickness, y along the
# length, z up, metres. A positive rotation tilts the top towards +x.
# `assumed` lists the keys whose values come from no source of yours: replace them with those of the
# certificates, the drawing and the scales, and take their names off the list.
"""
_COMMENT: Final = {
    "weight_n": "N",
    "rotational_inertia_kg_m2": "about the base corner; (4/3) m R² of a solid block",
    "r0_m": "from the base corner to the centre of mass",
    "alpha0_rad": "atan(thickness / height)",
    "p_rad_s": "sqrt(W R / I)",
    "connection": '"local": the NI driver of this machine; "grpcs://HOST:PORT": a remote NI device server',
}


def write_rig_text(
    block: Block,
    sensors: Sequence[Sensor],
    *,
    chassis: str = CHASSIS,
    modules: Sequence[str] = (),
    rate_hz: float = 4000.0,
    file: str = "rig",
) -> str:
    """A whole rig file that can be loaded and planned.

    Without `modules` there are as many NI 9205 as the sensors need. Raises `ConfigError` with every
    problem: a product that is not known, too few inputs, what a sensor says that cannot be.
    """
    modules = list(modules) or modules_for(sensors)
    wired = wire_up(sensors, chassis, modules, file)
    counts = Counter(sensor.family for sensor in wired)
    simulation = {"restitution": 0.9, "seed": 1, "assumed": ["restitution", "seed"]}
    parts = [
        _HEAD.format(name=block.name),
        _lines(
            {"schema_version": 1, "name": block.name, "description": f"{block.name}, {len(wired)} sensors"}
        ),
        _table("specimen", block.table()),
        _table("hardware", {"connection": "simulated"}),
        _chassis(chassis, modules),
        _table("acquisition", {"rate_hz": rate_hz}),
        _table("expected_channels", _expected(counts)),
        '# The wall behind connection = "simulated"; a real test does not read it.\n'
        + _table("simulation", simulation),
    ]
    defaults = _family_defaults()
    config = terminal_config(modules[0])
    parts += [_channel(sensor, defaults, config) for sensor in wired]
    text = "\n".join(parts)
    plan_tasks(parse_rig(text, file), file)
    return text


def _expected(counts: Mapping[str, int]) -> dict[str, int]:
    """The families of the rocking motion, and those auxiliary ones that are there."""
    families = get_args(Family)
    return {name: counts.get(name, 0) for name in families if name in counts or not is_auxiliary(name)}


def _family_defaults() -> Mapping[str, Mapping[str, Any]]:
    """What the rig files that come with the program say of each family of sensors."""
    path = shipped_configs() / "fr2.toml"
    defaults = parse_toml(read_text(path), str(path))["channel_defaults"]
    return {family: dict(table) for family, table in defaults.items()}


def _channel(sensor: Sensor, defaults: Mapping[str, Mapping[str, Any]], config: str) -> str:
    # A family that does not exist is told by the check of the whole text.
    base = dict(defaults.get(sensor.family, _auxiliary_base(sensor, defaults)))
    certificate = {"number": "unknown", **base.pop("certificate", {}), **sensor.keys.get("certificate", {})}
    base = {key: value for key, value in base.items() if key not in ("assumed", "terminal_config")}
    keys = dict(_reach(sensor, base))
    anchor = sensor.anchor_m
    assumed = [key for key in base if key not in sensor.keys and key != "axis"]
    if sensor.family == "wire" and anchor is None:
        x, y, z = sensor.position_m
        anchor = (x - _WIRE_M if x <= 0 else x + _WIRE_M, y, z)
        assumed.append("anchor_m")
    if set(sensor.keys.get("certificate", {})) != {"number", "calibrated", "due"}:
        assumed.append("certificate")
    table = {
        "id": sensor.id,
        "family": sensor.family,
        "physical_channel": sensor.physical_channel,
        "position_m": list(sensor.position_m),
        **({"anchor_m": list(anchor)} if anchor else {}),
        **keys,
        "terminal_config": config,
        "certificate": certificate,
        "assumed": assumed,
    }
    return "[[channels]]\n" + _lines(table)


def _auxiliary_base(sensor: Sensor, defaults: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Keys that an auxiliary channel has where the list gives none; empty for a family that there is not."""
    if not is_auxiliary(sensor.family):
        return {}
    noise = _NOISE_SHARE * max(map(abs, dict(_reach(sensor, {})).get("range_si", [1.0])))
    return {"noise_si": noise, "certificate": defaults["lvdt"]["certificate"]}


def _reach(sensor: Sensor, base: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Keys of the channel: the list's over the family's; the sensitivity tells a missing range."""
    given = {key: value for key, value in sensor.keys.items() if key != "certificate"}
    if "sensitivity" in given and "range_si" not in given:
        unit = str(given.get("sensitivity_unit", base.get("sensitivity_unit", "")))
        si_unit = FAMILY_SI_UNIT.get(sensor.family) or str(given.get("unit", ""))
        per_si = float(given["sensitivity"]) * sensitivity_units("voltage", si_unit).get(unit, 1.0)
        reach = (_REACH_V - abs(float(given.setdefault("offset", 0.0)))) / per_si if per_si else 0.0
        given["range_si"] = [round(-0.999 * reach, 6), round(0.999 * reach, 6)]
    yield from {
        **{k: v for k, v in base.items() if k not in ("certificate", "terminal_config")},
        **given,
    }.items()


def _chassis(product: str, modules: Sequence[str]) -> str:
    first = 2 if catalogue.chassis(product).bus == "pxie" else 1
    rows = "".join(
        f"  {{ slot = {slot}, product = {_value(name)} }},\n"
        for slot, name in enumerate(modules, start=first)
    )
    return (
        f"[[hardware.chassis]]\nname = {_value(chassis_name(product))}\nproduct = {_value(product)}\n"
        f"modules = [\n{rows}]\n"
    )


def _table(name: str, table: Mapping[str, Any]) -> str:
    return f"[{name}]\n{_lines(table)}"


def _lines(table: Mapping[str, Any]) -> str:
    return "".join(
        f"{key} = {_value(value)}{f'  # {_COMMENT[key]}' if key in _COMMENT else ''}\n"
        for key, value in table.items()
    )


def _value(value: Any) -> str:
    """One value on one line, as TOML."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(inner) for inner in value) + "]"
    return tomli_w.dumps({"v": value}).strip().removeprefix("v = ")

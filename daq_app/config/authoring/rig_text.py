"""The text of a new rig file, with comments for whoever edits it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, get_args

import tomli_w

from daq_app.config.authoring.block import Block
from daq_app.config.authoring.channel_keys import certificate_of
from daq_app.config.authoring.placement import Placed, modules_for, place
from daq_app.config.authoring.sensor import Sensor
from daq_app.config.authoring.terminals import CHASSIS, chassis_table, devices_in
from daq_app.config.families import Family, is_auxiliary
from daq_app.config.hardware.inventory import devices_of
from daq_app.config.hardware.wiring import terminal_of
from daq_app.config.loader import parse_rig
from daq_app.config.planning.planner import plan_tasks
from daq_app.config.rig import Rig, names

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
    hardware: Sequence[Mapping[str, Any]] = (),
    rate_hz: float = 4000.0,
    file: str = "rig",
) -> str:
    """A whole rig file that can be loaded and planned, each sensor on a module that can read it.

    The modules are those of `hardware` (tables of chassis, as a rig file has them), else `modules` slot by
    slot in a `chassis`, else as many usual ones as the sensors need. Raises `ConfigError` with every
    problem: a product that is not known, a sensor that no module reads, what a sensor says that cannot be.
    """
    if not hardware:
        modules = list(modules) or modules_for(sensors, chassis, rate_hz, file)
        hardware = [chassis_table(chassis, modules, file)]
    wired = place(sensors, devices_in(hardware, file), rate_hz, file)
    counts = Counter(_family(placed) for placed in wired)
    simulation = {"restitution": 0.9, "seed": 1, "assumed": ["restitution", "seed"]}
    parts = [
        _HEAD.format(name=block.name),
        _lines(
            {"schema_version": 1, "name": block.name, "description": f"{block.name}, {len(wired)} sensors"}
        ),
        _table("specimen", block.table()),
        _table("hardware", {"connection": "simulated"}),
        *(_chassis(table) for table in hardware),
        _table("acquisition", {"rate_hz": rate_hz}),
        _table("expected_channels", _expected(counts)),
        '# The wall behind connection = "simulated"; a real test does not read it.\n'
        + _table("simulation", simulation),
    ]
    parts += [_channel(placed) for placed in wired]
    text = "\n".join(parts)
    plan_tasks(parse_rig(text, file), file)
    return text


def wiring_lines(rig: Rig) -> Iterator[str]:
    """A line for each module that sensors are on: which, and how they are read."""
    devices, _ = devices_of(rig.hardware)
    for name, device in devices.items():
        mine = [channel for channel in rig.channels if terminal_of(channel)[0] == name]
        ways = {
            way: [c for c in mine if c.measurement == way]
            for way in dict.fromkeys(c.measurement for c in mine)
        }
        for way, channels in ways.items():
            guessed = ", assumed" if any("measurement" in channel.assumed for channel in channels) else ""
            product = device.product.name if device else "?"
            yield f"  {name} ({product}): {names(channels)} as {way}{guessed}"


def _family(placed: Placed) -> str:
    """The family that the rig file counts a sensor under: an LVDT along x or y is a displacement."""
    sideways = placed.sensor.family == "lvdt" and placed.sensor.keys.get("axis") in ("x", "y")
    return "displacement" if sideways else placed.sensor.family


def _expected(counts: Mapping[str, int]) -> dict[str, int]:
    """The families of the rocking motion, and those auxiliary ones that are there."""
    families = get_args(Family)
    return {name: counts.get(name, 0) for name in families if name in counts or not is_auxiliary(name)}


def _channel(placed: Placed) -> str:
    sensor = placed.sensor
    given = dict(sensor.keys.get("certificate", {}))
    certificate = {"number": "unknown", **certificate_of(sensor.family), **given}
    anchor = sensor.anchor_m
    assumed = list(placed.assumed)
    if sensor.family == "wire" and anchor is None:
        x, y, z = sensor.position_m
        anchor = (x - _WIRE_M if x <= 0 else x + _WIRE_M, y, z)
        assumed.append("anchor_m")
    if set(given) != {"number", "calibrated", "due"}:
        assumed.append("certificate")
    table = {
        "id": sensor.id,
        "family": sensor.family,
        "physical_channel": sensor.physical_channel,
        "position_m": list(sensor.position_m),
        **({"anchor_m": list(anchor)} if anchor else {}),
        **placed.keys,
        "certificate": certificate,
        "assumed": assumed,
    }
    return "[[channels]]\n" + _lines(table)


def _chassis(table: Mapping[str, Any]) -> str:
    rows = "".join(f"  {_value(module)},\n" for module in table["modules"])
    return (
        f"[[hardware.chassis]]\nname = {_value(table['name'])}\nproduct = {_value(table['product'])}\n"
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

"""Closing the loop: the rig file with what a diagnosis found switched on in its simulated wall."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from daq_app.config import load_rig, parse_rig
from daq_app.config.toml_file import parse_toml, read_text
from daq_app.gap.core import CannotDiagnose
from daq_app.gap.core.result import FORMAT_VERSION
from daq_app.runfile.durable import write_whole
from daq_app.runfile.folder import require_replaceable
from sim_hardware.dynamics.effects import MOTION_EFFECTS
from sim_hardware.dynamics.spec import find_effect
from sim_hardware.sensors.effects import SENSOR_EFFECTS

_MAX_BYTES: Final = 2**26
FORMS_ONLY: Final = {
    ("compliance", "fall"),
    ("ambient", "shift"),
    ("flexible_wall", "forced"),
    ("flexible_wall", "recoil"),
    ("initial_velocity", "own"),
    ("sliding", "back"),
    ("sliding_on", "back"),
    ("sliding_on", "own"),
    ("sliding", "slope"),
    ("sliding_on", "slope"),
}
"""Parameters that the simulator has not: of a form that it knows only one of, or of a run by itself."""
_MEASURED_ONLY: Final = ("ambient@floor", "acceleration@", "sliding@base", "corner_twist@base")
"""A floor that vibrates irregularly (the simulator's is a sinusoid), tiltmeters that feel acceleration, and a
base that slips between impacts (the simulator's does at impacts)."""


class _Part(BaseModel):
    """Part of a result; what it has besides is ignored."""

    model_config = ConfigDict(frozen=True)


class _Value(_Part):
    """A named number of a result."""

    name: Annotated[str, Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f-\x9f]+$")]
    value: Annotated[float, Field(allow_inf_nan=False)]


class _Wiring(_Part):
    """Channels whose plugs are reversed or in each other's places."""

    reversed: tuple[str, ...] = ()
    exchanged: dict[str, str] = Field(default_factory=dict)


class _Result(_Part):
    """The part of a diagnosis that can be switched on in a simulated wall."""

    decision: str
    effect_parameters: tuple[_Value, ...]
    parameters: tuple[_Value, ...]
    scatter: tuple[_Value, ...] = ()
    notes: dict[str, Any] = Field(default_factory=dict)


class _Wall(_Part):
    """Fitted parameters of the wall, SI."""

    alpha: Annotated[float, Field(gt=0.0, lt=math.pi / 2)]
    p: Annotated[float, Field(gt=0.0)]
    half_base: Annotated[float, Field(gt=0.0)]
    r: Annotated[float, Field(gt=0.0)]


def read_result(path: Path) -> dict[str, Any]:
    """The JSON of a diagnosis. Raises `CannotDiagnose` if the file is none."""
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise CannotDiagnose(f"{path} is far too large for a result of a diagnosis.")
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as problem:
        raise CannotDiagnose(f"{path} is no result of a diagnosis ({problem}).") from None
    if not isinstance(data, dict) or data.get("format") != FORMAT_VERSION or "effect_parameters" not in data:
        raise CannotDiagnose(f"{path} is no result of a diagnosis in format {FORMAT_VERSION}.")
    return data


def effects_found(result: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """Effects with their parameters as the simulator takes them. Raises `CannotDiagnose`."""
    checked = _checked(_Result, result)
    effects: dict[str, dict[str, float]] = {}
    for estimate in checked.effect_parameters:
        name, _, parameter = estimate.name.rpartition(".")
        if (name, parameter) in FORMS_ONLY or name.startswith(_MEASURED_ONLY):
            continue
        if name == "polarity" or name.startswith("swap"):
            effects |= _wired(name, checked)
            continue
        effects.setdefault(name, {})[parameter] = _possible(name, parameter, estimate.value)
    return effects


_Model = TypeVar("_Model", bound=BaseModel)


def _checked(model: type[_Model], data: object) -> _Model:
    try:
        return model.model_validate(data)
    except (ValidationError, RecursionError) as problem:
        where, what = "", str(problem)
        if isinstance(problem, ValidationError):
            first = problem.errors(include_url=False, include_input=False)[0]
            where, what = ".".join(map(str, first["loc"])) + ": ", first["msg"]
        raise CannotDiagnose(
            f"The result cannot be used ({where}{what}).", "Diagnose the runs again with this version."
        ) from None


def _wired(effect: str, result: _Result) -> dict[str, dict[str, float]]:
    """Reversed channels, or any exchange of plugs as exchanges of two, one after the other."""
    wiring = _checked(_Wiring, result.notes.get("wiring") or {})
    turned, exchanged = wiring.reversed, wiring.exchanged
    if effect == "polarity" and turned:
        return {f"polarity@{'+'.join(turned)}": {"on": 1.0}}
    if effect == "polarity" or not exchanged or set(exchanged) != set(exchanged.values()):
        raise CannotDiagnose(
            f"The result does not say which channels {effect} means.",
            "Diagnose the runs again with this version.",
        )
    plugged = {terminal: terminal for terminal in exchanged}
    steps = {}
    for terminal, sensor in exchanged.items():
        other = next(t for t, s in plugged.items() if s == sensor)
        if other != terminal:
            plugged[terminal], plugged[other] = plugged[other], plugged[terminal]
            steps[f"swap@{terminal}+{other}"] = {"places": 1.0}
    return steps


def _possible(effect: str, parameter: str, value: float) -> float:
    """A value as the simulator takes it: within what has a meaning, whole where it counts something."""
    try:
        spec = find_effect(effect, (*MOTION_EFFECTS, *SENSOR_EFFECTS)).parameter(parameter)
    except ValueError as problem:
        raise CannotDiagnose(
            f"The simulator cannot switch on {effect}.{parameter}: {problem}.", "Apply it by hand."
        ) from None
    if parameter == "on":
        value = float(round(value))
    return min(max(value, spec.minimum), spec.maximum)


def apply_result(
    result: Mapping[str, Any], rig: Path, out: Path, *, overwrite: bool = False
) -> dict[str, dict[str, float]]:
    """Write `out`: `rig` with fitted α, p, r, b, scatter of r, and the effects found. Returns the effects.

    Comments of the rig file are not kept. Raises `ConfigError` where a file is no rig, and
    `CannotDiagnose` where the result names nothing that can be switched on, `RunFileError` where `out` is
    there already or cannot be written; nothing is written then.
    """
    known = set(load_rig(rig).channel_ids)
    effects = effects_found(result)
    checked = _checked(_Result, result)
    wiring = _checked(_Wiring, checked.notes.get("wiring") or {})
    unknown = {*wiring.reversed, *wiring.exchanged, *wiring.exchanged.values()} - known
    if unknown:
        raise CannotDiagnose(
            f"The rig file has no channel {sorted(unknown)[0]!r}.", "Give the rig of these runs."
        )
    if not effects and checked.decision not in ("parameters", "nothing_missing"):
        raise CannotDiagnose(
            f"The diagnosis ended with {checked.decision!r}: there is no effect to switch on.",
            "Read its report.",
        )
    require_replaceable(out, (rig,), overwrite=overwrite)
    wall = _checked(_Wall, {value.name: value.value for value in checked.parameters})
    scatter = [value.value for value in checked.scatter if value.name == "scatter of r"]
    text = _rig_text(rig, wall, scatter, effects)
    parse_rig(text, str(out))
    write_whole(out, text)
    return effects


def _rig_text(rig: Path, wall: _Wall, scatter: Sequence[float], effects: dict[str, dict[str, float]]) -> str:
    data = parse_toml(read_text(rig), str(rig))
    specimen = data["specimen"]
    r0 = wall.half_base / math.sin(wall.alpha)
    specimen["alpha0_rad"], specimen["r0_m"], specimen["p_rad_s"] = wall.alpha, r0, wall.p
    specimen["rotational_inertia_kg_m2"] = specimen["weight_n"] * r0 / wall.p**2
    simulation = data.setdefault("simulation", {})
    simulation["restitution"] = min(wall.r, 1.0)
    if scatter:
        simulation["restitution_scatter"] = scatter[0]
    simulation["effects"] = {**simulation.get("effects", {}), **effects}
    if "assumed" in simulation:
        simulation["assumed"] = [k for k in simulation["assumed"] if k != "restitution_scatter"]
    return tomli_w.dumps(data)

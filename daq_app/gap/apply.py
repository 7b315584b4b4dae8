"""Closing the loop: the rig file with what a diagnosis found switched on in its simulated wall."""

from __future__ import annotations

import json
import math
import tomllib
from pathlib import Path
from typing import Any

import tomli_w

from daq_app.config import ConfigError, load_rig
from daq_app.gap.core import CannotDiagnose
from daq_app.gap.core.result import FORMAT_VERSION
from sim_hardware.dynamics.effects import MOTION_EFFECTS
from sim_hardware.dynamics.spec import find_effect
from sim_hardware.sensors.effects import SENSOR_EFFECTS

FORMS_ONLY = {("compliance", "fall"), ("ambient", "shift")}
"""Parameters that the simulator has not: of a form that it knows only one of, or read from a run itself."""


def read_result(path: Path) -> dict[str, Any]:
    """The JSON of a diagnosis. Raises `CannotDiagnose` if the file is none."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as problem:
        raise CannotDiagnose(f"{path} is no result of a diagnosis ({problem}).") from None
    if not isinstance(data, dict) or data.get("format") != FORMAT_VERSION or "effect_parameters" not in data:
        raise CannotDiagnose(f"{path} is no result of a diagnosis in format {FORMAT_VERSION}.")
    return data


def effects_found(result: dict[str, Any]) -> dict[str, dict[str, float]]:
    """Effects with their parameters as the simulator takes them."""
    effects: dict[str, dict[str, float]] = {}
    for estimate in result["effect_parameters"]:
        name, _, parameter = str(estimate["name"]).rpartition(".")
        if (name, parameter) in FORMS_ONLY:
            continue
        if name == "polarity" or name.startswith("swap"):
            effects |= _wired(name, result)
            continue
        effects.setdefault(name, {})[parameter] = _possible(name, parameter, float(estimate["value"]))
    return effects


def _wired(effect: str, result: dict[str, Any]) -> dict[str, dict[str, float]]:
    """Reversed channels, or any exchange of plugs as exchanges of two, one after the other."""
    wiring = result.get("notes", {}).get("wiring", {})
    turned, exchanged = wiring.get("reversed", ()), wiring.get("exchanged", {})
    if effect == "polarity" and turned:
        return {f"polarity@{'+'.join(turned)}": {"on": 1.0}}
    if effect == "polarity" or not exchanged:
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


def apply_result(result: dict[str, Any], rig: Path, out: Path) -> dict[str, dict[str, float]]:
    """Write `out`: `rig` with fitted α, p, r, b, scatter of r, and the effects found. Returns the effects.

    Comments of the rig file are not kept. Raises `ConfigError` where a file is no rig, and
    `CannotDiagnose` where the result names nothing that can be switched on.
    """
    load_rig(rig)
    effects = effects_found(result)
    if not effects and result["decision"] not in ("parameters", "nothing_missing"):
        raise CannotDiagnose(
            f"The diagnosis ended with {result['decision']}: there is no effect to switch on.",
            "Read its report.",
        )
    data = tomllib.loads(rig.read_text(encoding="utf-8-sig"))
    values = {p["name"]: float(p["value"]) for p in result["parameters"]}
    specimen = data["specimen"]
    r0 = values["half_base"] / math.sin(values["alpha"])
    specimen["alpha0_rad"], specimen["r0_m"], specimen["p_rad_s"] = values["alpha"], r0, values["p"]
    specimen["rotational_inertia_kg_m2"] = specimen["weight_n"] * r0 / values["p"] ** 2
    simulation = data.setdefault("simulation", {})
    simulation["restitution"] = min(values["r"], 1.0)
    scatter = [s["value"] for s in result["scatter"] if s["name"] == "scatter of r"]
    if scatter:
        simulation["restitution_scatter"] = float(scatter[0])
    simulation["effects"] = {**simulation.get("effects", {}), **effects}
    if "assumed" in simulation:
        simulation["assumed"] = [k for k in simulation["assumed"] if k != "restitution_scatter"]
    text = tomli_w.dumps(data)
    out.write_text(text, encoding="utf-8")
    try:
        load_rig(out)
    except ConfigError:
        out.unlink()
        raise
    return effects

"""The whole library of effects: on the motion and on the sensors, under one roof."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from sim_hardware.dynamics.effects import MOTION_EFFECTS
from sim_hardware.dynamics.spec import EffectSpec, Parameter, find_effect, parse_effect, split_target
from sim_hardware.sensors.effects import SENSOR_EFFECTS

ALL_EFFECTS: Final[tuple[EffectSpec, ...]] = MOTION_EFFECTS + SENSOR_EFFECTS
_MOTION_NAMES: Final = frozenset(spec.name for spec in MOTION_EFFECTS)

Effects = dict[str, dict[str, float]]


def split_effects(effects: Mapping[str, Mapping[str, float]]) -> tuple[Effects, Effects]:
    """(on the motion, on the sensors), checked; `ValueError` in words for one unknown or wrong."""
    motion: Effects = {}
    sensors: Effects = {}
    for key, given in effects.items():
        spec = find_effect(key, ALL_EFFECTS)
        values = spec.complete(given)
        if spec.name in _MOTION_NAMES:
            if split_target(key)[1]:
                raise ValueError(
                    f"effect {key!r} acts on the wall, not on sensors: leave out what follows '@'"
                )
            motion[spec.name] = values
        else:
            sensors[key] = values
    return motion, sensors


__all__ = [
    "ALL_EFFECTS",
    "MOTION_EFFECTS",
    "SENSOR_EFFECTS",
    "EffectSpec",
    "Effects",
    "Parameter",
    "find_effect",
    "parse_effect",
    "split_effects",
    "split_target",
]

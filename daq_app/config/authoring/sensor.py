"""A sensor as its owner lists it, before it is a channel of a rig file."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

Position = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Sensor:
    """One row of a sensor list: place in metres in the wall's frame; the rest as in a rig file."""

    id: str
    family: str
    position_m: Position
    physical_channel: str = ""
    """Empty: the next free terminal."""
    anchor_m: Position | None = None
    keys: dict[str, Any] = field(default_factory=dict)
    """Further keys of the channel that the list gives: axis, sensitivity, certificate and so on;
    `excitation_value`, volts, becomes the channel's excitation on its module."""

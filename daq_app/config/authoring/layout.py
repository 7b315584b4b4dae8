"""Sensors spread over a wall, for an owner who has no list yet."""

from __future__ import annotations

from collections.abc import Mapping

from daq_app.config.authoring.block import Block
from daq_app.config.authoring.sensor import Position, Sensor

_PREFIX = {"lvdt": "LV", "wire": "WP", "accelerometer": "AC", "tiltmeter": "TM"}
_TOP_SHARE = 0.95
"""Height of the uppermost wire and accelerometer over the wall's. Assumed."""


def spread_sensors(block: Block, counts: Mapping[str, int]) -> list[Sensor]:
    """So many sensors of each family at the places that rocking tests give them.

    LVDTs stand along both faces of the base joint in turn, wires and accelerometers up the middle of a
    face, tiltmeters near the top with axes x and y in turn.
    """
    sensors = []
    for family, count in counts.items():
        for number in range(count):
            keys = {"axis": "xy"[number % 2]} if family == "tiltmeter" else {}
            name = f"{_PREFIX[family]}-{number + 1:02d}"
            sensors.append(Sensor(name, family, _place(block, family, number, count), keys=keys))
    return sensors


def _place(block: Block, family: str, number: int, count: int) -> Position:
    half = block.thickness_m / 2
    if family == "lvdt":
        pairs = (count + 1) // 2
        along = ((number // 2) + 0.5) / pairs - 0.5
        return (round((-half, half)[number % 2], 4), round(along * block.length_m, 4), 0.0)
    if family == "tiltmeter":
        return (0.0, 0.0, round(0.9 * block.height_m, 3))
    height = _TOP_SHARE * block.height_m * (number + 1) / count
    return (round(-half if family == "wire" else half, 4), 0.0, round(height, 3))

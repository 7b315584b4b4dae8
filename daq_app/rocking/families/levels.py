"""Which family is off in the rotation of the held wall."""

from __future__ import annotations

from collections.abc import Mapping

from daq_app.rocking.families import words
from daq_app.rocking.families.finding import FamilyFinding

_APART = 0.01
"""θ0 of a family off the other two by more than this share is named: three times what calibration leaves."""
_APART_RAD = 2e-4


def level_outlier(levels_rad: Mapping[str, float]) -> FamilyFinding | None:
    """The family that is off where the two others agree; None where all agree, or of fewer than three."""
    if len(levels_rad) < 3:
        return None
    for name, value in levels_rad.items():
        others = [other for key, other in levels_rad.items() if key != name]
        middle = sum(others) / 2.0
        limit = max(_APART * abs(middle), _APART_RAD)
        if abs(others[0] - others[1]) < 0.5 * abs(value - middle) and abs(value - middle) > limit:
            return words.level(name, value - middle, value / middle - 1.0)
    return None

"""What walls on real bases also do: ring, twist about a corner, hang on a cable, stand on shaken floors.

The laboratories beside `own` hide these too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from daq_app.gap.blind.world.effects.catalogue import ENTRIES, LIBRARY, Entry, uniform
from daq_app.gap.blind.world.effects.contact_catalogue import CONTACT_ENTRIES, CONTACT_LIBRARY

_RING: Final = ENTRIES["flexible_wall"]
_FAST_RING: Final = replace(
    _RING, others=uniform(frequency_hz=(7.0, 42.0), zeta=(0.005, 0.05), recoil=(0.0, 0.2))
)
_SLOW_RING: Final = replace(
    _RING,
    low=0.03,
    high=0.3,
    others=uniform(frequency_hz=(2.0, 7.0), zeta=(0.005, 0.05), recoil=(0.0, 0.2)),
)
_CORNER_TWIST: Final = Entry("corner_twist", "contact", "turn_s", 3e-4, 6e-3, signed=True)
_TAUT_CABLE: Final = Entry(
    "taut_cable",
    "release",
    "k",
    0.01,
    0.15,
    others=uniform(reach_rad=(0.02, 0.1), side=(-1.0, 1.0), moved=(0.0, 1.0)),
)
_IRREGULAR_FLOOR: Final = Entry(
    "irregular_floor",
    "ambient",
    "rms_m_s2",
    0.05,
    0.25,
    others=uniform(low_hz=(1.5, 5.0), band_hz=(2.0, 6.0)),
)

WIDE_ENTRIES: Final[Mapping[str, Entry]] = {
    **ENTRIES,
    "flexible_wall": _FAST_RING,
    "slow_flexible_wall": _SLOW_RING,
    "corner_twist": _CORNER_TWIST,
    "taut_cable": _TAUT_CABLE,
    "irregular_floor": _IRREGULAR_FLOOR,
}
WIDE_LIBRARY: Final = (*LIBRARY, "slow_flexible_wall", "corner_twist", "taut_cable", "irregular_floor")

WIDE_CONTACT_ENTRIES: Final[Mapping[str, Entry]] = {**CONTACT_ENTRIES, "corner_twist": _CORNER_TWIST}
WIDE_CONTACT_LIBRARY: Final = (
    *CONTACT_LIBRARY,
    "gain",
    "lag",
    "slow_response",
    "drift",
    "wire_inertia",
    "quantisation",
    "corner_twist",
)

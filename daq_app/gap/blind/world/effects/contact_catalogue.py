"""Effects that a case of the contact engine can hide: what wall and floor are where they touch.

They are those of the library whose table entry is a shape or a place, which the engine is given. Where
the table has a formula for what contact does (a slip c ω, an impact on a Winkler bed that takes r), friction
and a bed as an engine knows them are other forms: these are outside.
"""

from __future__ import annotations

from typing import Final

from daq_app.gap.blind.world.effects.catalogue import ENTRIES, LIBRARY, Entry, uniform

_LIBRARY: Final = (
    ENTRIES["pivot_shift"],
    ENTRIES["rounded_edge"],
    ENTRIES["crushing"],
    ENTRIES["alpha_asymmetry"],
    ENTRIES["base_tilt"],
    ENTRIES["eccentric_mass"],
)
_OUTSIDE: Final = (
    Entry("one_round_edge", "interface", "rho_m", 0.008, 0.06, kind="near"),
    # Low: a wall that never tips over its step turns on the inner edge, and that is a shifted pivot.
    Entry(
        "stepped_edge", "interface", "height_m", 3e-4, 6e-4, others=uniform(width_m=(0.02, 0.08)), kind="near"
    ),
    Entry("damped_bed", "interface", "theta_c_rad", 1e-4, 9e-4, kind="near"),
    Entry("slippery_base", "contact", "friction_share", 0.99, 0.9, kind="near"),
    Entry("slippery_edge", "contact", "friction_share", 0.99, 0.9, kind="near"),
)
_ON_SENSORS: Final = tuple(entry for entry in (ENTRIES[name] for name in LIBRARY) if entry.on_sensors)

CONTACT_ENTRIES: Final[dict[str, Entry]] = {
    entry.name: entry for entry in (*_LIBRARY, *_OUTSIDE, *_ON_SENSORS)
}
CONTACT_LIBRARY: Final = tuple(entry.name for entry in _LIBRARY)
CONTACT_OUTSIDE: Final = tuple(entry.name for entry in _OUTSIDE)
BESIDE_CONTACT: Final = tuple(entry.name for entry in _ON_SENSORS)
"""Faults of sensors: what a contact-born effect makes a pair with."""

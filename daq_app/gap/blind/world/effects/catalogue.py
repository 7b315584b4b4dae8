"""Every effect that a case can hide: name, family, how strong it may be, on which channels it acts.

`library` effects are those of the table in the design page (the diagnosis may know them); `near` ones
are another form of a family of that table; `far` ones belong to none of its forms.

A contact engine is given shapes and places. Where the table has a formula for what contact does (a slip c ω,
an impact on a Winkler bed that takes r), friction and a bed as an engine knows them are other forms: these
are outside. Laboratories beside `own` also hide what walls on real bases do: they ring, twist about a corner,
hang on a cable, stand on shaken floors.
Strengths are drawn between `low` and `high` on a logarithmic scale; the first parameter carries them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np

from daq_app.config import Channel, Rig

Kind = Literal["library", "near", "far"]
Parameters = dict[str, float]
Targets = Callable[[Rig, np.random.Generator], tuple[str, ...]]


def _no_targets(rig: Rig, rng: np.random.Generator) -> tuple[str, ...]:
    return ()


@dataclass(frozen=True, slots=True)
class Entry:
    """One effect that a case can hide."""

    name: str
    family: str
    parameter: str
    """The parameter that carries the strength, with its unit as suffix."""
    low: float
    high: float
    targets: Targets = _no_targets
    others: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Other parameters, each drawn evenly from its range."""
    signed: bool = False
    kind: Kind = "library"

    @property
    def on_sensors(self) -> bool:
        return self.targets is not _no_targets


@dataclass(frozen=True, slots=True)
class Drawn:
    """An effect with its values. `strength` is its place in the range, 0 weakest to 1 strongest."""

    name: str
    family: str
    kind: Kind
    parameters: Parameters
    targets: tuple[str, ...]
    strength: float


def draw(entry: Entry, rig: Rig, rng: np.random.Generator, strength: float | None = None) -> Drawn:
    """Values for an effect; `strength` in [0, 1] fixes the place in its range."""
    place = float(rng.uniform()) if strength is None else strength
    value = entry.low * (entry.high / entry.low) ** place
    if entry.signed and rng.uniform() < 0.5:
        value = -value
    others = {name: float(rng.uniform(*limits)) for name, limits in entry.others.items()}
    parameters = {entry.parameter: value, **others}
    return Drawn(entry.name, entry.family, entry.kind, parameters, entry.targets(rig, rng), place)


def _of(*families: str) -> Targets:
    """All channels of one of the families."""

    def choose(rig: Rig, rng: np.random.Generator) -> tuple[str, ...]:
        family = families[int(rng.integers(len(families)))]
        return tuple(c.id for c in rig.channels if c.family == family and _moves(c))

    return choose


def _one(*families: str) -> Targets:
    """One channel of one of the families."""
    every = _of(*families)

    def choose(rig: Rig, rng: np.random.Generator) -> tuple[str, ...]:
        ids = every(rig, rng)
        return (ids[int(rng.integers(len(ids)))],)

    return choose


def _one_or_all(*families: str) -> Targets:
    one, every = _one(*families), _of(*families)
    return lambda rig, rng: one(rig, rng) if rng.uniform() < 0.6 else every(rig, rng)


def _moves(channel: Channel) -> bool:
    """Channels that see rocking at all: a tiltmeter across it shows no fault of scale or time."""
    return not (channel.family == "tiltmeter" and channel.axis != "x")


def _pair(rig: Rig, rng: np.random.Generator) -> tuple[str, ...]:
    """Two channels of one family that see different things."""
    family = ("lvdt", "wire", "accelerometer")[int(rng.integers(3))]
    channels = [c for c in rig.channels if c.family == family]
    while True:
        a, b = rng.choice(len(channels), 2, replace=False)
        first, second = channels[int(a)], channels[int(b)]
        differ = first.position_m[0] != second.position_m[0] or (
            abs(first.position_m[2] - second.position_m[2]) > 0.3
        )
        if differ and first.axis == second.axis:
            return (first.id, second.id)


def _any(rig: Rig, rng: np.random.Generator) -> tuple[str, ...]:
    ids = [c.id for c in rig.channels]
    return tuple(ids[int(i)] for i in sorted(rng.choice(len(ids), 3, replace=False)))


_LIBRARY: Final = (
    Entry("pivot_shift", "interface", "a_m", 0.008, 0.05),
    Entry("winkler", "interface", "theta_c_rad", 1e-5, 9e-4),
    Entry("rounded_edge", "interface", "rho_m", 0.008, 0.06),
    Entry("crushing", "interface", "loss_per_100", 0.001, 0.03),
    Entry("restitution_wear", "interface", "loss_per_100", 0.002, 0.03),
    Entry("restitution_slope", "restitution", "k_s_rad", 0.005, 0.05, signed=True),
    Entry("restitution_asymmetry", "restitution", "d", 0.002, 0.02, signed=True),
    Entry("viscous", "dissipation", "zeta", 0.001, 0.02),
    Entry("coulomb", "dissipation", "mu", 0.001, 0.02),
    Entry("alpha_asymmetry", "geometry", "delta_rad", 2e-4, 5e-3, signed=True),
    Entry("base_tilt", "geometry", "beta_rad", 2e-4, 5e-3, signed=True),
    Entry("eccentric_mass", "geometry", "e_m", 3e-4, 7.5e-3, signed=True),
    Entry("sliding", "contact", "c_m_s", 1e-3, 2e-2, others={"square": (0.0, 1.0)}),
    Entry("dwell", "contact", "tau_s", 5e-4, 1e-2),
    Entry("bounce", "contact", "tau_s", 1e-3, 1e-2),
    Entry(
        "flexible_wall",
        "structure",
        "gain",
        0.05,
        0.6,
        others={"frequency_hz": (9.0, 35.0), "zeta": (0.01, 0.05)},
    ),
    Entry("compliance", "structure", "phi_rad", 1e-4, 3e-3),
    Entry(
        "yaw",
        "structure",
        "gain",
        0.03,
        0.5,
        others={"frequency_hz": (2.0, 8.0), "zeta": (0.01, 0.05)},
        signed=True,
    ),
    Entry("residual_cable", "release", "k", 0.005, 0.2, others={"slack": (0.2, 0.7)}),
    Entry("initial_velocity", "release", "omega_rad_s", 3e-3, 3e-2, signed=True),
    Entry("slow_release", "release", "tau_s", 0.02, 0.4),
    Entry("ambient", "ambient", "amplitude_m_s2", 5e-3, 0.1, others={"frequency_hz": (0.5, 4.0)}),
    Entry("gain", "sensor", "error", 0.01, 0.1, _one_or_all("lvdt", "wire", "accelerometer"), signed=True),
    Entry("drift", "sensor", "rate_rad_s", 2e-5, 1e-3, _one_or_all("lvdt", "wire"), signed=True),
    Entry("lag", "sensor", "tau_s", 1e-3, 0.05, _of("lvdt", "wire", "accelerometer")),
    Entry("slow_response", "sensor", "tau_s", 1e-3, 0.05, _one_or_all("lvdt", "wire")),
    Entry("filter_delay", "sensor", "tau_s", 1e-3, 0.03, _of("lvdt", "wire", "accelerometer")),
    Entry("saturation", "sensor", "cut", 0.05, 0.5, _of("lvdt", "wire")),
    Entry("dropout", "sensor", "share", 0.01, 0.2, _one("lvdt", "wire"), {"duration_s": (0.02, 0.3)}),
    Entry("quantisation", "sensor", "times_noise", 4.0, 40.0, _one_or_all("lvdt", "wire")),
    Entry("wire_cosine", "sensor", "anchor_m", 0.03, 0.4, _one_or_all("wire"), signed=True),
    Entry("wire_sag", "sensor", "kappa_1_m", 0.03, 0.5, _one_or_all("wire"), signed=True),
    Entry("wire_inertia", "sensor", "frequency_hz", 6.0, 30.0, _of("wire"), {"zeta": (0.05, 0.4)}),
    Entry("hum", "sensor", "times_noise", 0.5, 10.0, _one_or_all("lvdt", "wire", "accelerometer")),
    Entry("clock", "sensor", "error", 0.002, 0.07, signed=True),
    Entry("polarity", "sensor", "on", 1.0, 1.0, _one("lvdt", "wire", "accelerometer")),
    Entry("swap", "sensor", "on", 1.0, 1.0, _pair),
)

_OUTSIDE: Final = (
    Entry("quadratic_drag", "dissipation", "c", 0.02, 0.4, kind="near"),
    Entry("one_sided_drag", "dissipation", "rate_1_s", 0.02, 0.2, kind="near"),
    Entry(
        "stepped_restitution",
        "restitution",
        "step",
        0.01,
        0.06,
        others={"speed_rad_s": (0.1, 0.3)},
        signed=True,
        kind="near",
    ),
    Entry("restitution_memory", "restitution", "drop", 0.02, 0.15, kind="near"),
    Entry("cubic_joint", "interface", "theta_j_rad", 1e-3, 8e-3, kind="near"),
    Entry(
        "hysteretic_joint",
        "interface",
        "share",
        0.02,
        0.2,
        others={"theta_h_rad": (1e-3, 8e-3)},
        kind="near",
    ),
    Entry("sudden_crack", "interface", "loss", 0.01, 0.05, kind="near"),
    Entry("cubic_gain", "sensor", "share", 0.03, 0.3, _of("lvdt", "wire"), signed=True, kind="near"),
    Entry("backlash", "sensor", "play_m", 2e-3, 1e-2, _one("wire"), kind="far"),
    Entry(
        "loose_bracket",
        "sensor",
        "size_si",
        0.01,
        0.1,
        _one("lvdt", "wire"),
        {"frequency_hz": (8.0, 60.0)},
        kind="far",
    ),
    Entry(
        "amplifier_temperature",
        "sensor",
        "share",
        0.01,
        0.06,
        _of("lvdt", "wire"),
        {"warm_up_s": (300.0, 1500.0)},
        signed=True,
        kind="far",
    ),
    Entry("crosstalk", "sensor", "share", 0.02, 0.15, _any, kind="far"),
    Entry("spikes", "sensor", "times_noise", 15.0, 80.0, _any, {"per_second": (0.5, 5.0)}, kind="far"),
    Entry(
        "passing_lorry",
        "ambient",
        "amplitude_m_s2",
        0.1,
        0.8,
        others={"frequency_hz": (6.0, 15.0)},
        kind="far",
    ),
    Entry("rope_snag", "release", "strength", 0.05, 0.5, others={"at_s": (0.6, 2.0)}, kind="far"),
)

ENTRIES: Final[dict[str, Entry]] = {entry.name: entry for entry in _LIBRARY + _OUTSIDE}
LIBRARY: Final = tuple(entry.name for entry in _LIBRARY)
OUTSIDE: Final = tuple(entry.name for entry in _OUTSIDE)

CONTACT_LIBRARY: Final = (
    "pivot_shift",
    "rounded_edge",
    "crushing",
    "alpha_asymmetry",
    "base_tilt",
    "eccentric_mass",
)
_CONTACT_OUTSIDE: Final = (
    Entry("one_round_edge", "interface", "rho_m", 0.008, 0.06, kind="near"),
    # Low: a wall that never tips over its step turns on the inner edge, and that is a shifted pivot.
    Entry("stepped_edge", "interface", "height_m", 3e-4, 6e-4, others={"width_m": (0.02, 0.08)}, kind="near"),
    Entry("damped_bed", "interface", "theta_c_rad", 1e-4, 9e-4, kind="near"),
    Entry("slippery_base", "contact", "friction_share", 0.99, 0.9, kind="near"),
    Entry("slippery_edge", "contact", "friction_share", 0.99, 0.9, kind="near"),
)
CONTACT_OUTSIDE: Final = tuple(entry.name for entry in _CONTACT_OUTSIDE)
BESIDE_CONTACT: Final = tuple(entry.name for entry in _LIBRARY if entry.on_sensors)
"""Faults of sensors: what a contact-born effect makes a pair with."""
CONTACT_ENTRIES: Final[Mapping[str, Entry]] = {
    **{name: ENTRIES[name] for name in (*CONTACT_LIBRARY, *BESIDE_CONTACT)},
    **{entry.name: entry for entry in _CONTACT_OUTSIDE},
}

_RING: Final = ENTRIES["flexible_wall"]
_FAST_RING: Final = replace(
    _RING, others={"frequency_hz": (7.0, 42.0), "zeta": (0.005, 0.05), "recoil": (0.0, 0.2)}
)
_SLOW_RING: Final = replace(
    _RING,
    low=0.03,
    high=0.3,
    others={"frequency_hz": (2.0, 7.0), "zeta": (0.005, 0.05), "recoil": (0.0, 0.2)},
)
_CORNER_TWIST: Final = Entry("corner_twist", "contact", "turn_s", 3e-4, 6e-3, signed=True)
_TAUT_CABLE: Final = Entry(
    "taut_cable",
    "release",
    "k",
    0.01,
    0.15,
    others={"reach_rad": (0.02, 0.1), "side": (-1.0, 1.0), "moved": (0.0, 1.0)},
)
_IRREGULAR_FLOOR: Final = Entry(
    "irregular_floor",
    "ambient",
    "rms_m_s2",
    0.05,
    0.25,
    others={"low_hz": (1.5, 5.0), "band_hz": (2.0, 6.0)},
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

"""The laboratories: one table of ranges.

What is set by looking at cases (thresholds, priors, discrepancy of the diagnosis) is set on laboratories that
are not `left_out`; those are for judging: nobody looks into their cases before a diagnosis is frozen.

What an ordinary laboratory does to a recording is no cause that anyone wants named. The size of an
imperfection is one number for each case; what each channel or run has of it is drawn around that number.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np

from daq_app.gap.blind.world.laboratories.numerics import Engine, NumericsRanges, Range, log_uniform
from daq_app.gap.blind.world.shock import ShockForm


@dataclass(frozen=True, slots=True)
class Imperfection:
    """One ordinary imperfection. `unit` is that of its size; "noises" counts in rms noise of the channel."""

    name: str
    unit: str
    meaning: str


_ELECTRONICS: Final = (
    Imperfection("mains_pick_up", "noises", "amplitude at 50 ± 0.03 Hz and harmonics, own phases"),
    Imperfection("slow_noise", "noises", "first-order noise that forgets 5 % with each sample"),
    Imperfection("pink_noise", "noises", "1/f noise from 0.05 Hz to 300 Hz"),
    Imperfection("unequal_noise", "factor", "noise of families and channels lies within 1/size to size"),
    Imperfection("zero_walk", "noises", "random walk of a zero from the start of a record to its end"),
    Imperfection("zero_start", "noises", "zero of a channel at the start of each run"),
    Imperfection("cable_shake", "noises", "burst of a shaken cable after an impact of 0.1 rad/s"),
    Imperfection("cable_step", "noises", "what a moved cable keeps after an impact of 0.1 rad/s"),
    Imperfection("spikes", "1/s", "single wrong samples of 5 to 25 noises, in each tenth channel"),
    Imperfection("crosstalk", "1", "share of the channel that the module scanned before, in volts"),
    Imperfection("coarse_steps", "bit", "bits of 16 that a module lacks, at most"),
    Imperfection("skew", "s", "a module samples later or earlier, at most"),
    Imperfection("calibration", "1", "standard deviation of a channel's gain"),
    Imperfection("late", "s", "delay of the LVDTs' amplifiers, at most"),
)
_WALL: Final = (
    Imperfection("lean", "rad", "standard deviation of a base's tilt, and of half the difference of its α"),
    Imperfection(
        "slope_of_r", "s/rad", "standard deviation of the slope of r over speed; 8 times that of sides"
    ),
    Imperfection("bed", "√rad", "root of the rotation at which a bed of mortar begins to open"),
)
_INSTALLATION: Final = (
    Imperfection("mount_angle", "rad", "standard deviation of the turn of accelerometers and tiltmeters"),
    Imperfection("anchor_error", "m", "standard deviation of a wire's anchor along each axis"),
    Imperfection("tilt_constant", "1", "a tiltmeter's time constant is off by this share at most"),
    Imperfection("wire_backlash", "m", "play of a wire's drum, at most"),
    Imperfection("wire_sag", "1/m", "share of a wire's travel that sag takes for each metre, at most"),
    Imperfection(
        "lvdt_straightness", "1", "share of its range by which an LVDT departs from a straight line"
    ),
    Imperfection("impact_shock", "s", "length of an impact's shock in the accelerometers; 0.002 in `own`"),
)
_TEST: Final = (
    Imperfection("sway", "rad", "amplitude of the held wall's sway at 0.4 to 3 Hz"),
    Imperfection("release_scatter", "1", "standard deviation of the release rotation; 0.01 in `own`"),
    Imperfection("impact_scatter", "1", "standard deviation of r from impact to impact"),
    Imperfection(
        "survey", "factor", "errors of centroid height (0.8 %) and inertia (3 %) are this many times larger"
    ),
    Imperfection("record_length", "s", "records begin 1.5 s to this much before the release and end as late"),
)

IMPERFECTIONS: Final[dict[str, Imperfection]] = {
    imperfection.name: imperfection for imperfection in (*_ELECTRONICS, *_INSTALLATION, *_WALL, *_TEST)
}

Chain = Literal["own", "bench", "field"]
"""Which code makes readings of signals: noise, filter, converter."""


@dataclass(frozen=True, slots=True)
class Laboratory:
    """Ranges from which a case draws the sizes of its imperfections (log-uniform)."""

    name: str
    meaning: str
    chain: Chain
    engines: tuple[Engine, ...]
    """Cases take turns."""
    ranges: Mapping[str, Range]
    """Imperfection → range of its size; one that is not named is as in `own`."""
    shocks: tuple[ShockForm, ...] = ("half_sine",)
    rates_hz: tuple[float, ...] = ()
    """Sampling rates that cases take turns with; the rig file's if empty."""
    numerics: NumericsRanges = field(default_factory=NumericsRanges)
    wide: bool = True
    """Whether its walls also ring from 2 to 42 Hz, twist about a corner and hide three effects."""
    left_out: bool = False

    def alone(self, imperfection: str) -> Laboratory:
        """This laboratory with one imperfection only, the others as in `own`; the sizes drawn are the same.

        Raises `ValueError` for one that it does not have.
        """
        if imperfection not in self.ranges:
            raise ValueError(
                f"laboratory {self.name} has no imperfection {imperfection}; it has {', '.join(self.ranges)}"
            )
        return replace(
            self,
            name=f"{self.name}: {imperfection} alone",
            ranges={imperfection: self.ranges[imperfection]},
            shocks=self.shocks if imperfection == "impact_shock" else ("half_sine",),
            rates_hz=(),
            numerics=NumericsRanges(),
            wide=False,
        )


def draw_sizes(laboratory: Laboratory, seed: int, index: int) -> dict[str, float]:
    """Sizes of the imperfections of case `index`: each depends on its own name, seed and place only."""
    return {
        name: log_uniform(limits, np.random.default_rng([seed, index, zlib.crc32(name.encode())]))
        for name, limits in laboratory.ranges.items()
    }


def laboratory(name: str) -> Laboratory:
    """The laboratory of a name. Raises `ValueError` for one that does not exist."""
    try:
        return LABORATORIES[name]
    except KeyError:
        raise ValueError(f"there is no laboratory {name}; there are {', '.join(LABORATORIES)}") from None


_ORDINARY: Final[Mapping[str, Range]] = {
    "mains_pick_up": (0.02, 1.0),
    "slow_noise": (0.1, 0.7),
    "pink_noise": (0.05, 0.3),
    "unequal_noise": (1.2, 2.0),
    "zero_walk": (0.05, 0.4),
    "zero_start": (0.05, 0.3),
    "crosstalk": (2e-4, 2e-3),
    "coarse_steps": (0.5, 1.5),
    "skew": (1e-5, 1e-4),
    "calibration": (0.001, 0.003),
    "late": (2e-4, 2e-3),
    "lean": (5e-5, 4e-4),
    "slope_of_r": (5e-4, 3e-3),
    "bed": (2e-4, 7e-4),
    "mount_angle": (0.002, 0.01),
    "anchor_error": (0.001, 0.004),
    "tilt_constant": (0.03, 0.15),
    "lvdt_straightness": (2e-4, 1.2e-3),
    "impact_shock": (0.002, 0.006),
    "sway": (1e-5, 6e-5),
    "release_scatter": (0.01, 0.03),
    "impact_scatter": (0.001, 0.006),
    "survey": (1.0, 2.5),
    "record_length": (2.0, 4.0),
}
_ROUGH: Final[Mapping[str, Range]] = {
    **_ORDINARY,
    "pink_noise": (0.1, 0.8),
    "zero_walk": (0.1, 0.8),
    "zero_start": (0.05, 0.5),
    "cable_shake": (0.3, 4.0),
    "cable_step": (0.05, 0.5),
    "spikes": (0.01, 0.2),
    "crosstalk": (0.001, 0.01),
    "coarse_steps": (1.0, 4.0),
    "skew": (5e-5, 5e-4),
    "calibration": (0.0015, 0.004),
    "mount_angle": (0.01, 0.035),
    "anchor_error": (0.003, 0.010),
    "tilt_constant": (0.1, 0.5),
    "wire_backlash": (2e-5, 3e-4),
    "wire_sag": (0.001, 0.01),
    "impact_shock": (0.002, 0.015),
    "sway": (3e-5, 3e-4),
}
_MIXED: Final[Mapping[str, Range]] = {
    **_ROUGH,
    "pink_noise": (0.05, 0.6),
    "cable_shake": (0.1, 2.0),
    "cable_step": (0.02, 0.3),
    "crosstalk": (5e-4, 5e-3),
    "coarse_steps": (0.5, 3.0),
    "mount_angle": (0.005, 0.035),
    "tilt_constant": (0.05, 0.5),
    "wire_backlash": (1e-5, 2e-4),
    "sway": (1e-5, 2e-4),
}
_EVERY_SHOCK: Final[tuple[ShockForm, ...]] = ("half_sine", "two_lobed", "ringing")
_EVENT_NUMERICS: Final = NumericsRanges(("DOP853", "RK45", "LSODA"), (1e-9, 1e-7))
_CONTACT_NUMERICS: Final = NumericsRanges(
    step_s=(0.6e-4, 1.2e-4),
    settle_s=(3e-4, 1.2e-3),
    cones=("elliptic", "pyramidal"),
    constraint_solvers=("Newton", "CG"),
)

LABORATORIES: Final[dict[str, Laboratory]] = {
    one.name: one
    for one in (
        Laboratory(
            "own",
            "white noise, calibration and zeros only; effects of the design's table",
            "own",
            ("events",),
            {},
            wide=False,
        ),
        Laboratory(
            "ordinary",
            "what every laboratory has: pick-up, slow noise, walking zeros, calibration, survey",
            "bench",
            ("events",),
            _ORDINARY,
            rates_hz=(4000.0, 4000.0, 2500.0),
            numerics=_EVENT_NUMERICS,
        ),
        Laboratory(
            "rough",
            "also turned mounts, tiltmeter constants, shocks, shaken cables, sway, backlash, coarse steps",
            "bench",
            ("events",),
            _ROUGH,
            shocks=_EVERY_SHOCK,
            rates_hz=(4000.0, 2000.0, 5000.0),
            numerics=_EVENT_NUMERICS,
        ),
        Laboratory(
            "contact",
            "the imperfections of `ordinary` on walls that a contact engine moves, hard or soft",
            "bench",
            ("contact",),
            _ORDINARY,
            shocks=_EVERY_SHOCK,
            numerics=_CONTACT_NUMERICS,
        ),
        Laboratory(
            "held_out_event",
            "imperfections of `ordinary` to `rough` through another sensor chain; for judging only",
            "field",
            ("events",),
            _MIXED,
            shocks=("gamma", "two_lobed", "ringing"),
            rates_hz=(4000.0, 3200.0, 2000.0),
            numerics=NumericsRanges(("Radau", "RK45", "LSODA"), (3e-9, 3e-7)),
            left_out=True,
        ),
        Laboratory(
            "held_out_contact",
            "the same chain on walls that a contact engine moves; for judging only",
            "field",
            ("contact",),
            _MIXED,
            shocks=("gamma", "ringing"),
            numerics=NumericsRanges(
                step_s=(0.5e-4, 0.8e-4),
                settle_s=(2e-4, 1e-3),
                cones=("pyramidal",),
                constraint_solvers=("CG", "Newton"),
            ),
            left_out=True,
        ),
    )
}

assert all(name in IMPERFECTIONS for one in LABORATORIES.values() for name in one.ranges)

"""The effects that the diagnosis knows, by the simulator's names, so that each can be switched on there."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

from daq_app.gap.core import Confusion, Effect, Indistinguishable, Library, Parameter
from daq_app.gap.core.parameters import between, positive, signed
from daq_app.gap.rocking_model.probes import departures, probes
from daq_app.gap.rocking_model.tolerances.walls import NEGLIGIBLE
from sim_hardware.dynamics.effects import MOTION_EFFECTS
from sim_hardware.dynamics.spec import EffectSpec
from sim_hardware.dynamics.spec import Parameter as SpecParameter
from sim_hardware.sensors.effects import SENSOR_EFFECTS

_NO_CAUSES = ("restitution_scatter", "quadratic_drag", "cubic")
"""Effects of the simulator that are none here: a scatter that is estimated with every hypothesis, and other
forms of a law, which probes and departures have to notice."""
_FREE = {
    "bounce": ("tau",),
    "restitution_slope": ("k",),
    "twist": ("kick", "frequency", "zeta"),
    "ambient": ("amplitude", "frequency"),
    "slow_release": ("tau",),
    "corner_twist": ("c",),
    "sliding": ("c",),
    "sliding_on": ("c",),
    "alpha_asymmetry": ("delta",),
    "eccentric_mass": ("e",),
}
"""Which parameters are fitted where not all are; the others keep the simulator's defaults."""
_LOGARITHMIC = {("winkler", "theta_c"), ("slow_release", "tau"), ("residual_cable", "slack")} | {
    (name, parameter)
    for name in ("flexible_wall", "yaw", "twist", "ambient", "wire_inertia")
    for parameter in ("frequency", "zeta")
}
_PER_RUN = {("residual_cable", "slack")}
"""A cable is paid out anew for every test: where it grips is each run's own."""
_SENSORS = {
    "gain": ("lvdt", "wire", "tiltmeter", "accelerometer"),
    "lag": ("lvdt", "wire", "accelerometer"),
    "slow_response": ("lvdt", "wire"),
    "filter_delay": ("lvdt", "wire"),
    "drift": ("lvdt", "wire", "tiltmeter"),
    "wire_cosine": ("wire",),
    "wire_anchor": ("wire",),
    "wire_inertia": ("wire",),
}
_ON_SENSORS = {spec.name: spec for spec in SENSOR_EFFECTS}
_OF_ALL = ("gain", "lag", "slow_response", "filter_delay", "drift")
_ONE_CHANNEL: dict[str, tuple[str, ...]] = {
    "lvdt": _OF_ALL,
    "wire": (*_OF_ALL, "wire_cosine", "wire_anchor", "wire_inertia"),
    "accelerometer": ("gain", "drift"),
}
_STARTS = {
    ("wire_inertia", "frequency"): (8.0, 14.0, 24.0),
    ("wire_inertia", "zeta"): (0.1, 0.3),
    # On a fixed side, or on that of the release.
    ("taut_cable", "k"): (0.05,),
    ("taut_cable", "loose"): (-0.04, 0.04),
    ("taut_cable", "release"): (-0.08, 0.0, 0.08),
}
"""Values from which a fit starts where one to either side of the prior's centre will not do."""
SMALLEST = {("residual_cable", "slack"): 4e-3}
"""Lower end of a range that the simulator lets begin at zero."""
_RANGES = {
    ("flexible_wall", "frequency"): (2.0, 42.0),
    ("yaw", "frequency"): (1.5, 14.0),
    ("twist", "frequency"): (1.5, 14.0),
    ("slow_release", "tau"): (0.005, 1.0),
}
"""Where walls and releases go beyond the simulator's usual ranges: slender walls on soft beds ring below
5 Hz, squat ones above 30 Hz (`rings` looks for them there), and a winch or a leaking jack lets go within a
second."""
_WIDER = {
    ("yaw", "kick"): 2.0,
    ("twist", "kick"): 2.0,
    ("flexible_wall", "gain"): 0.2,
    ("filter_delay", "tau"): 0.05,
}
"""Reach of strengths that have no usual size: how hard an impact kicks depends on its very form, and where it
goes with the wall's speed it is a multiple of the jump, which is a tenth of the speed; how far the wall bends
goes with one over its frequency. A filter may be as late as any other sensor: with a shorter
reach it would be the likelier answer for short delays, whose form the runs do not show."""
_FURTHEST = {("dwell", "tau"): 0.3, ("residual_cable", "k"): 3.0}
"""Ends of strengths beyond six times their reach. A wall that stays on its joint for longer than its fit may
say leaves the rest of that to the sample clock; a rope of steel that is left on is as stiff as the wall is
heavy."""
_DRIFT_REACH = {"lvdt": 1e-3, "wire": 2e-3, "tiltmeter": 1e-3, "accelerometer": 1e-2}


_WEAKEST_SIGNED = {
    "restitution_slope": 5e-3,
    "restitution_asymmetry": 2e-3,
    "alpha_asymmetry": 2e-4,
    "base_tilt": 2e-4,
    "initial_velocity": 3e-3,
    "eccentric_mass": 3e-4,
    "gain": 0.01,
    "wire_anchor": 0.03,
    "corner_twist": 3e-4,
    "sliding_on": 2e-4,
}
"""Where the design's ranges begin for strengths of either sign, which the simulator's do not say. A mass off
centre begins where it turns gravity as a tilt of 0.2 mrad does, the slope of r at a tenth of its range."""


def _smallest(spec: EffectSpec, parameter: SpecParameter) -> float:
    """Strength below which an effect is none; 0 where no range says so."""
    if parameter is not spec.strength:
        return 0.0
    weakest = max(parameter.low, 0.0) or _WEAKEST_SIGNED.get(spec.name, 0.0)
    return NEGLIGIBLE * weakest


def _parameter(spec: EffectSpec, parameter: SpecParameter) -> Parameter:
    """The prior of one of the simulator's parameters: its range is about two prior sd."""
    key = (spec.name, parameter.name)
    if logarithmic := key in _LOGARITHMIC:
        low = max(parameter.low, SMALLEST.get(key, 1e-6))
        ends = _RANGES.get(key, (low, parameter.high))
        prior = between(parameter.name, *ends, parameter.unit, parameter.text)
    else:
        of_sign = signed if parameter.low < 0 else positive
        prior = of_sign(parameter.name, _WIDER.get(key, parameter.high), parameter.unit, parameter.text)
    prior = replace(prior, starts=_STARTS.get(key, prior.starts), high=_FURTHEST.get(key, prior.high))
    if key in _PER_RUN:
        return replace(prior, per_run=True)
    return prior if logarithmic else replace(prior, smallest=_smallest(spec, parameter))


_PLASTIC = Parameter(
    "plastic", 0.5, 0.5, "1", 0.0, 1.0, meaning="share of a plastic impact's difference of r"
)
"""Unequal levers make r of the two sides differ where impacts are plastic. A real wall loses another share of
its speed than a plastic impact takes: its r may differ by anything from nothing to that."""
_DRAWN_BACK = Parameter(
    "back", 0.5, 0.5, "1", 0.0, 1.5, meaning="share of what a slip takes back of the rotation"
)
"""A base that slips leaves the wall behind: 1 for a rigid block, 0 for slips that act back on nothing."""
_SQUARE = Parameter(
    "square", 0.5, 0.4, "1", 0.0, 1.0, meaning="share of a slip that goes with the square of the speed"
)
"""An impact throws the base aside with a speed in proportion to its own, and friction stops it over a way in
proportion to the square of that."""
_SLOPE_OF_SLIPS = Parameter(
    "slope", 0.0, 0.03, "s/rad", meaning="slope of r over speed that slips make", starts=(0.0,)
)
"""Friction takes another share of the speed at fast impacts than at slow ones, where a base may not slip."""
_FORMS = {
    "alpha_asymmetry": (_PLASTIC,),
    "eccentric_mass": (_PLASTIC,),
    "compliance": (
        Parameter("fall", 0.5, 0.4, "1", 0.0, 1.0, meaning="share that falls with the overturning moment"),
    ),
    # An impact kicks a wall at its base, or stops a wall whose own inertia goes on bending it.
    "flexible_wall": (
        Parameter("forced", 0.5, 0.4, "1", 0.0, 1.0, meaning="share of its own inertia in its bending"),
        Parameter("recoil", 0.0, 0.5, "1", 0.0, 1.5, meaning="turn of the base against it, over its tilt"),
    ),
    "sliding": (_DRAWN_BACK, _SQUARE, _SLOPE_OF_SLIPS),
    # In one test further than in another.
    "sliding_on": (
        _DRAWN_BACK,
        _SQUARE,
        _SLOPE_OF_SLIPS,
        Parameter(
            "own", 0.0, 0.4, "1", meaning="what each test's slips differ by", per_run=True, starts=(0.0,)
        ),
    ),
    # On and on, back and forth, or at one edge alone.
    "corner_twist": (
        Parameter("alternation", 0.0, 0.8, "rad", -math.pi / 2, math.pi / 2, meaning="how it turns back"),
    ),
    # Who pushes does so in every test, now more and now less.
    "initial_velocity": (
        Parameter(
            "own",
            0.0,
            5e-3,
            "rad/s",
            meaning="what each test's speed differs by",
            per_run=True,
            starts=(0.0,),
        ),
    ),
    # Nobody knows how a hand or a winch lets go: from a force that dies away to one paid out evenly.
    "slow_release": (Parameter("even", 0.5, 0.4, "1", 0.0, 1.0, meaning="how evenly the force falls"),),
    # Read from the run itself while the wall stands still, and carried on over its motion.
    "ambient": (
        Parameter(
            "shift", 0.0, 1.0, "1", meaning="error of the phase read at rest", per_run=True, starts=(0.0,)
        ),
    ),
}
"""Parameters of the form of an effect, within the bounds of what it can be."""


def _motion_effect(spec: EffectSpec, known: set[str]) -> Effect:
    names = _FREE.get(spec.name, tuple(p.name for p in spec.parameters if p.name != "v_mean"))
    return Effect(
        spec.name,
        spec.family,
        tuple(_parameter(spec, p) for p in spec.parameters if p.name in names) + _FORMS.get(spec.name, ()),
        spec.equation,
        spec.reference,
        spec.summary,
        tuple(Confusion(other, spec.separated_by) for other in spec.confusable if other in known),
    )


def _sensor_effect(name: str, target: str, family: str, known: set[str]) -> Effect:
    """An effect on the sensors of a family or on one channel."""
    spec = _ON_SENSORS[name]
    parameters = tuple(_parameter(spec, p) for p in spec.parameters)
    if name == "drift":
        unit = {"tiltmeter": "rad/s", "accelerometer": "m/s³"}.get(family, "m/s")
        parameters = (signed("rate", _DRIFT_REACH[family], unit, "drift of the zero"),)
    return Effect(
        f"{name}@{target}",
        "sensor",
        parameters,
        spec.equation,
        spec.reference,
        f"{spec.summary} ({target})",
        tuple(Confusion(other, spec.separated_by) for other in spec.confusable if other in known),
        part_of=f"{name}@{family}" if target != family else "",
        place=target if target != family else "",
    )


def _sensor_effects(known: set[str]) -> Iterable[Effect]:
    for name, families in _SENSORS.items():
        for family in families:
            yield _sensor_effect(name, family, family, known)
    clock = _ON_SENSORS["clock"]
    yield Effect(
        "clock",
        "sensor",
        (signed("error", 0.07, "1", clock.strength.text),),
        clock.equation,
        clock.reference,
        clock.summary,
    )


_INDISTINGUISHABLE = (
    # Not dwell and bounce: a hop lasts longer the faster the wall comes, which several levels show.
    Indistinguishable(
        ("base_tilt", "eccentric_mass"),
        "Both turn gravity against the wall by the same angle; a mass off centre also changes the p of the "
        "two sides, by 0.1 %, which the calibrations of the two faces of the joint may feign.",
        "a level on the base",
    ),
)
_INDISTINGUISHABLE_ON_SENSORS = (
    ("lag", "filter_delay"),
    "Where the rotation has its energy, below 20 Hz, a Bessel filter of some milliseconds is a delay.",
    "a step or a knock on the sensor: a filter rounds it, a delay does not",
)


def _indistinguishable(names: Collection[str]) -> Iterable[Indistinguishable]:
    """Effects that no sensor of the rig tells apart, as far as the library has them."""
    yield from _INDISTINGUISHABLE
    first, *others = _INDISTINGUISHABLE_ON_SENSORS[0]
    for target in sorted({name.partition("@")[2] for name in names if name.startswith(first + "@")}):
        same = tuple(f"{name}@{target}" for name in (first, *others))
        if all(name in names for name in same):
            yield Indistinguishable(same, *_INDISTINGUISHABLE_ON_SENSORS[1:])


def rocking_library(channels: Mapping[str, str] | None = None) -> Library:
    """All effects, probes and departures.

    `channels` are those that disagree with their family, each with its family: the effects on a single
    sensor are added for each, under its name.
    """
    specs = [spec for spec in MOTION_EFFECTS if spec.name not in _NO_CAUSES]
    known = {spec.name for spec in specs}
    single = [
        _sensor_effect(name, channel, family, known)
        for channel, family in (channels or {}).items()
        for name in _ONE_CHANNEL[family]
    ]
    motion = (_motion_effect(spec, known) for spec in specs)
    effects = [*motion, *_sensor_effects(known), *single, *probes(), *departures()]
    return Library(effects, _indistinguishable({effect.name for effect in effects}))

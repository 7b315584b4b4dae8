"""The ambiguous pairs, from both sides: little recorded at first, then what the library names as well."""

from __future__ import annotations

from dataclasses import dataclass

from daq_app.gap.blind.world.effects.catalogue import Drawn
from studies.cannot_tell.measured import KNOCK, LEVEL, RULE, Instrument
from studies.cannot_tell.wall import Recorded, truth_of


@dataclass(frozen=True, slots=True)
class Case:
    """One effect, what it is taken for, and what is recorded before and after."""

    name: str
    """The truth by the diagnosis' name."""
    other: str
    """What it is taken for; empty for nothing missing."""
    truth: Drawn
    named: str
    """Name of the measurement that the library names for the pair."""
    little: Recorded
    before: str
    more: Recorded
    added: str
    instrument: Instrument | None = None
    reading: float = 0.0
    """What the instrument would show without error."""

    @property
    def everything(self) -> Recorded:
        """All that has to be simulated."""
        longest = max((self.little, self.more), key=lambda part: len(part.levels))
        return Recorded(longest.levels, (), max(self.little.hold_s, self.more.hold_s))


L1 = Recorded((0.15,))
FOUR = Recorded((0.15, -0.25, 0.35, 0.40))
REPEATED = Recorded((*FOUR.levels, -0.15, 0.25))
MANY = Recorded(
    (*FOUR.levels, *(sign * level for level in (0.1, 0.2, 0.3, 0.35, 0.4, 0.45) for sign in (1, -1)))
)
_LEVELS = "three tests at higher levels, to both sides"
_STEP = "a step or a knock on the sensor"
_ONE = "one test, L1"


def _case(
    name: str,
    value: float,
    other: str,
    named: str,
    little: Recorded,
    before: str,
    more: Recorded,
    added: str,
    instrument: Instrument | None = None,
    reading: float = 0.0,
    **others: float,
) -> Case:
    truth = truth_of(name, value, others)
    return Case(name, other, truth, named, little, before, more, added, instrument, reading)


def _both() -> list[Case]:
    level, rule = "a level on the base", "height of the LVDTs' points"
    spread, again = "several levels", "half-cycle durations at equal peaks"
    later = "five tests at all levels, L1 and L2 repeated at the end"
    four = "four tests, L1 to L4"
    return [
        _case("viscous", 0.005, "coulomb", spread, L1, _ONE, FOUR, _LEVELS),
        _case("coulomb", 0.0025, "viscous", spread, L1, _ONE, FOUR, _LEVELS),
        _case("restitution_slope", 0.05, "viscous", "energy within a swing", L1, _ONE, FOUR, _LEVELS),
        _case("restitution_asymmetry", 0.006, "", "Repeat over more levels", L1, _ONE, FOUR, _LEVELS),
        _case("crushing", 0.015, "restitution_wear", again, L1, _ONE, REPEATED, later),
        _case("restitution_wear", 0.015, "crushing", again, L1, _ONE, REPEATED, later),
        _case("pivot_shift", 0.02, "rounded_edge", rule, FOUR, four, FOUR, "height by a rule, ± 2 mm", RULE),
        _case("rounded_edge", 0.03, "pivot_shift", rule, FOUR, four, FOUR, "height by a rule, ± 2 mm", RULE),
        _case("base_tilt", 1.5e-3, "eccentric_mass", level, L1, _ONE, L1, _LEVEL_WORDS, LEVEL, 1.5e-3),
        _case("eccentric_mass", 2e-3, "base_tilt", level, L1, _ONE, L1, _LEVEL_WORDS, LEVEL),
        _case(
            "lag@wire", 0.006, "filter_delay@wire", _STEP, L1, _ONE, L1, "a knock on a wire's sensor", KNOCK
        ),
        _case(
            "filter_delay@wire",
            0.006,
            "lag@wire",
            _STEP,
            L1,
            _ONE,
            L1,
            "a knock on a wire's sensor",
            KNOCK,
            1.0,
        ),
    ]


def _others() -> list[Case]:
    """Pairs that the library calls confusable, at strengths near what six tests detect at all."""
    marks, quarter = "two marks per impact on the accelerometers", "the first quarter-cycle"
    sound = "the accelerometers"
    deaf = Recorded(L1.levels, ("accelerometer",))
    one = "one test, L1, no accelerometers"
    seen = "accelerometers do not show it"
    return [
        _case("dwell", 1e-3, "bounce", "LVDTs and accelerometers", L1, _ONE, FOUR, _LEVELS),
        _case("bounce", 4e-3, "dwell", marks, L1, _ONE, FOUR, _LEVELS),
        _case("slow_release", 0.03, "initial_velocity", quarter, L1, _ONE, FOUR, _LEVELS),
        _case("initial_velocity", 0.005, "slow_release", quarter, L1, _ONE, FOUR, _LEVELS),
        _case("winkler", 3e-5, "compliance", "tiltmeter on the base", L1, _ONE, FOUR, _LEVELS),
        _case("compliance", 2e-4, "winkler", "tiltmeter on the base", L1, _ONE, FOUR, _LEVELS),
        _case(
            "flexible_wall",
            0.08,
            "wire_inertia@wire",
            seen,
            deaf,
            one,
            L1,
            sound,
            frequency_hz=16.0,
            zeta=0.03,
        ),
        _case("wire_inertia@wire", 22.0, "flexible_wall", seen, deaf, one, L1, sound, zeta=0.2),
        _case("ambient", 0.03, "", "record before release", deaf, one, L1, sound, frequency_hz=2.3),
    ]


def _forms() -> list[Case]:
    """Laws that are just there, so that another form of their family would leave the same runs."""
    four, words = "four tests, L1 to L4", "twelve tests more, from a tenth to 0.45 of α"
    lower = "release from lower and from higher levels"
    return [
        _case("restitution_slope", 0.025, "free_restitution", lower, FOUR, four, MANY, words),
        _case("viscous", 0.001, "free_dissipation", lower, FOUR, four, MANY, words),
    ]


_LEVEL_WORDS = "a level on the base, ± 0.05 mrad"
CASES = {case.name: case for case in (*_both(), *_others())} | {f"{c.name}.form": c for c in _forms()}
"""By the truth's name; where it is the form that is asked for, with `.form` behind it."""

"""Which effects the cases of a check hide: the mix of the design page, drawn from one seed.

The contact engine has a mix of its own: effects that are born in the contact, the same shares.

In every 20 cases: 11 single effects, 3 pairs, 4 from outside the library, 2 with nothing; in the wide
mix, that of the laboratories beside `own`, a triple takes the place of a single effect. Effects are dealt
like cards, so that each comes up before any comes up twice. Case k of a seed is the same however many
cases are made.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from daq_app.config import Rig
from daq_app.gap.blind.world.effects.catalogue import (
    BESIDE_CONTACT,
    CONTACT_ENTRIES,
    CONTACT_LIBRARY,
    CONTACT_OUTSIDE,
    ENTRIES,
    LIBRARY,
    OUTSIDE,
    WIDE_CONTACT_ENTRIES,
    WIDE_CONTACT_LIBRARY,
    WIDE_ENTRIES,
    WIDE_LIBRARY,
    Drawn,
    Entry,
    draw,
)
from daq_app.gap.blind.world.laboratories.numerics import Engine

Category = Literal["single", "pair", "triple", "outside", "null"]

_BLOCK: Final[tuple[Category, ...]] = ("single",) * 11 + ("pair",) * 3 + ("outside",) * 4 + ("null",) * 2
_WIDE_BLOCK: Final[tuple[Category, ...]] = ("triple", *_BLOCK[1:])
_SINGLE, _PAIR, _OUTSIDE_DECK, _ORDER, _WORLD, _TRIPLE = range(6)
_JOINT_FORMS: Final = {"pivot_shift", "winkler", "rounded_edge", "cubic_joint"}
_IMPACT_FORMS: Final = {"dwell", "bounce"}
_WIRING: Final = {"polarity", "swap"}
NOTHING: Final = "nothing"
"""Name of the choice to hide no effect."""
_GEOMETRY: Final = {"alpha_asymmetry", "base_tilt", "eccentric_mass"}


@dataclass(frozen=True, slots=True)
class _Decks:
    """What is dealt: effects of the library, the further ones of pairs and triples, effects outside it."""

    entries: Mapping[str, Entry]
    library: tuple[str, ...]
    beside: tuple[str, ...]
    outside: tuple[str, ...]
    block: tuple[Category, ...] = _BLOCK


_DECKS: Final[dict[tuple[Engine, bool], _Decks]] = {
    ("events", False): _Decks(ENTRIES, LIBRARY, LIBRARY, OUTSIDE),
    ("contact", False): _Decks(CONTACT_ENTRIES, CONTACT_LIBRARY, BESIDE_CONTACT, CONTACT_OUTSIDE),
    ("events", True): _Decks(WIDE_ENTRIES, WIDE_LIBRARY, WIDE_LIBRARY, OUTSIDE, _WIDE_BLOCK),
    ("contact", True): _Decks(
        WIDE_CONTACT_ENTRIES,
        WIDE_CONTACT_LIBRARY,
        (*CONTACT_LIBRARY, *BESIDE_CONTACT),
        CONTACT_OUTSIDE,
        _WIDE_BLOCK,
    ),
}
"""(engine, whether the mix is the wide one) → what is dealt."""


def category_of(seed: int, index: int, wide: bool = False) -> Category:
    """Category of case `index` (from 0)."""
    block = _WIDE_BLOCK if wide else _BLOCK
    return _order(seed, index // len(block), block)[index % len(block)]


def case_generator(seed: int, index: int) -> np.random.Generator:
    """The random numbers of one case."""
    return np.random.default_rng([seed, _WORLD, index])


def draw_effects(
    seed: int,
    index: int,
    rig: Rig,
    rng: np.random.Generator,
    engine: Engine = "events",
    wide: bool = False,
) -> tuple[Drawn, ...]:
    """What case `index` hides, of what the engine can simulate."""
    decks = _DECKS[engine, wide]
    category = category_of(seed, index, wide)
    place = _place(seed, index, category, decks.block)
    match category:
        case "single":
            return (draw(decks.entries[_dealt(seed, _SINGLE, decks.library, place)], rig, rng),)
        case "outside":
            return (draw(decks.entries[_dealt(seed, _OUTSIDE_DECK, decks.outside, place)], rig, rng),)
        case "pair":
            return _several(decks, 2, _dealt(seed, _PAIR, decks.library, place), rig, rng)
        case "triple":
            return _several(decks, 3, _dealt(seed, _TRIPLE, decks.library, place), rig, rng)
        case "null":
            return ()


def draw_named(name: str, rig: Rig, rng: np.random.Generator, engine: Engine = "events") -> tuple[Drawn, ...]:
    """One effect of this name, or none for `nothing`. Raises `ValueError` for one that does not exist."""
    entries = _DECKS[engine, True].entries
    if name == NOTHING:
        return ()
    if name not in entries:
        raise ValueError(f"there is no effect {name} to hide; there are {NOTHING}, {', '.join(entries)}")
    return (draw(entries[name], rig, rng),)


def _several(decks: _Decks, count: int, first: str, rig: Rig, rng: np.random.Generator) -> tuple[Drawn, ...]:
    """Library effects of different families, all in the stronger half of their ranges."""
    entries, names = decks.entries, [first]
    while len(names) < count:
        others = [
            name
            for name in decks.beside
            if not any(_exclusive(name, known) or _alike(entries, name, known, count) for known in names)
        ]
        names.append(others[int(rng.integers(len(others)))])
    return tuple(draw(entries[name], rig, rng, float(rng.uniform(0.5, 1.0))) for name in names)


def _alike(entries: Mapping[str, Entry], name: str, known: str, count: int) -> bool:
    """Whether two effects are of one family, or are one effect; two faults of sensors may make a triple."""
    if count > 2 and entries[name].on_sensors and entries[known].on_sensors:
        return entries[name].name == entries[known].name
    return entries[name].family == entries[known].family


def _exclusive(a: str, b: str) -> bool:
    """Effects that are one thing, or of which one hides the other."""
    groups = (_JOINT_FORMS, _IMPACT_FORMS, _WIRING, _GEOMETRY)
    return any(a in group and b in group for group in groups)


def _order(seed: int, number: int, block: Sequence[Category]) -> list[Category]:
    shuffled = np.random.default_rng([seed, _ORDER, number]).permutation(len(block))
    return [block[int(i)] for i in shuffled]


def _place(seed: int, index: int, category: Category, block: Sequence[Category]) -> int:
    """How many cases of this category come before."""
    number, within = divmod(index, len(block))
    return number * block.count(category) + _order(seed, number, block)[:within].count(category)


def _dealt(seed: int, deck: int, names: Sequence[str], place: int) -> str:
    number, within = divmod(place, len(names))
    order = np.random.default_rng([seed, deck, 7, number]).permutation(len(names))
    return names[int(order[within])]

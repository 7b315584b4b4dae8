"""Which effects the cases of a check hide: the mix of the design page, drawn from one seed.

The contact engine has a mix of its own: effects that are born in the contact, the same shares.

In every 20 cases: 11 single effects, 3 pairs, 4 from outside the library, 2 with nothing. Effects
are dealt like cards, so that each comes up before any comes up twice. Case k of a seed is the same
however many cases are made.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from daq_app.config import Rig
from daq_app.gap.blind.world.course import Engine
from daq_app.gap.blind.world.effects.catalogue import ENTRIES, LIBRARY, OUTSIDE, Drawn, Entry, draw
from daq_app.gap.blind.world.effects.contact_catalogue import (
    BESIDE_CONTACT,
    CONTACT_ENTRIES,
    CONTACT_LIBRARY,
    CONTACT_OUTSIDE,
)

Category = Literal["single", "pair", "outside", "null"]

_BLOCK: Final[tuple[Category, ...]] = ("single",) * 11 + ("pair",) * 3 + ("outside",) * 4 + ("null",) * 2
_SINGLE, _PAIR, _OUTSIDE_DECK, _ORDER, _WORLD = range(5)
_JOINT_FORMS: Final = {"pivot_shift", "winkler", "rounded_edge", "cubic_joint"}
_IMPACT_FORMS: Final = {"dwell", "bounce"}
_WIRING: Final = {"polarity", "swap"}
_GEOMETRY: Final = {"alpha_asymmetry", "base_tilt", "eccentric_mass"}


@dataclass(frozen=True, slots=True)
class _Decks:
    """What is dealt: effects of the library, the second ones of pairs, effects outside the library."""

    entries: Mapping[str, Entry]
    library: tuple[str, ...]
    beside: tuple[str, ...]
    outside: tuple[str, ...]


_DECKS: Final[dict[Engine, _Decks]] = {
    "events": _Decks(ENTRIES, LIBRARY, LIBRARY, OUTSIDE),
    "contact": _Decks(CONTACT_ENTRIES, CONTACT_LIBRARY, BESIDE_CONTACT, CONTACT_OUTSIDE),
}


def category_of(seed: int, index: int) -> Category:
    """Category of case `index` (from 0)."""
    return _order(seed, index // len(_BLOCK))[index % len(_BLOCK)]


def case_generator(seed: int, index: int) -> np.random.Generator:
    """The random numbers of one case."""
    return np.random.default_rng([seed, _WORLD, index])


def draw_effects(
    seed: int, index: int, rig: Rig, rng: np.random.Generator, engine: Engine = "events"
) -> tuple[Drawn, ...]:
    """What case `index` hides, of what the engine can simulate."""
    decks = _DECKS[engine]
    category = category_of(seed, index)
    place = _place(seed, index, category)
    match category:
        case "single":
            return (draw(decks.entries[_dealt(seed, _SINGLE, decks.library, place)], rig, rng),)
        case "outside":
            return (draw(decks.entries[_dealt(seed, _OUTSIDE_DECK, decks.outside, place)], rig, rng),)
        case "pair":
            return _pair(decks, seed, place, rig, rng)
        case "null":
            return ()


def _pair(decks: _Decks, seed: int, place: int, rig: Rig, rng: np.random.Generator) -> tuple[Drawn, ...]:
    """Two library effects of different families, both in the stronger half of their ranges."""
    entries = decks.entries
    first = _dealt(seed, _PAIR, decks.library, place)
    others = [name for name in decks.beside if entries[name].family != entries[first].family]
    others = [name for name in others if not _exclusive(first, name)]
    second = others[int(rng.integers(len(others)))]
    return tuple(draw(entries[name], rig, rng, float(rng.uniform(0.5, 1.0))) for name in (first, second))


def _exclusive(a: str, b: str) -> bool:
    """Pairs that are one thing, or of which one hides the other."""
    groups = (_JOINT_FORMS, _IMPACT_FORMS, _WIRING, _GEOMETRY)
    return any(a in group and b in group for group in groups)


def _order(seed: int, block: int) -> list[Category]:
    shuffled = np.random.default_rng([seed, _ORDER, block]).permutation(len(_BLOCK))
    return [_BLOCK[int(i)] for i in shuffled]


def _place(seed: int, index: int, category: Category) -> int:
    """How many cases of this category come before."""
    block, within = divmod(index, len(_BLOCK))
    return block * _BLOCK.count(category) + _order(seed, block)[:within].count(category)


def _dealt(seed: int, deck: int, names: Sequence[str], place: int) -> str:
    number, within = divmod(place, len(names))
    order = np.random.default_rng([seed, deck, 7, number]).permutation(len(names))
    return names[int(order[within])]

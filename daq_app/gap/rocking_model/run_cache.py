"""The one cache of the rocking model: what is worked out of a run, kept while nothing it depends on changes.

A fit moves one value at a time, and most parts of a prediction depend on few. What a part depends on is
not declared but seen: it is given its values through a mapping that notes what is asked for. A part that
is a pure function of its values asks for the same ones as long as they are the same, so the note is complete.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping
from typing import Any, NamedTuple, TypeVar

_BY_NAME = "a part of a prediction asks for values by name"
_KEPT = 6
"""Results kept of each part: a fit goes back to its last values after every step of its differences."""
T = TypeVar("T")


class _Known(NamedTuple):
    """One result of a part, with the names that it asked for and their values."""

    keys: tuple[str, ...]
    given: tuple[float | None, ...]
    result: Any


class RunCache:
    """What has been worked out of one run; a run that is changed begins with an empty one."""

    def __init__(self) -> None:
        self._constants: dict[Hashable, Any] = {}
        self._parts: dict[Hashable, list[_Known]] = {}

    def constant(self, key: Hashable, make: Callable[[], T]) -> T:
        """What the run alone decides, made once."""
        if key not in self._constants:
            self._constants[key] = make()
        value: T = self._constants[key]
        return value

    def part(self, key: Hashable, values: Mapping[str, float], make: Callable[[Mapping[str, float]], T]) -> T:
        """What `make` makes of the values; worked out only if something that it asks for is new."""
        # A part within another one looks at the plain values; the other one depends on what decided.
        outer = values if type(values) is _Watched else None
        plain = outer.plain if outer is not None else values
        listed = self._parts.setdefault(key, [])
        known = _found(listed, plain)
        if known is None:
            watched = _Watched(plain)
            result = make(watched)
            asked = tuple(watched.asked)
            keys = next((old.keys for old in listed if old.keys == asked), asked)
            known = _Known(keys, tuple(map(plain.get, keys)), result)
            if len(listed) == _KEPT:
                del listed[0]
            listed.append(known)
        if outer is not None:
            outer.asked.update(dict.fromkeys(known.keys))
        value: T = known.result
        return value


def _found(listed: list[_Known], values: Mapping[str, float]) -> _Known | None:
    """The result for these values, which becomes the last one; results used last come last."""
    asked: tuple[str, ...] = ()
    given: tuple[float | None, ...] = ()
    for place in range(len(listed) - 1, -1, -1):
        known = listed[place]
        if known.keys is not asked:  # most ask for the same
            asked = known.keys
            given = tuple(map(values.get, asked))
        if given == known.given:
            if known is not listed[-1]:
                listed.append(listed.pop(place))
            return known
    return None


class _Watched(Mapping[str, float]):
    """Values that note which of them were asked for. Their names cannot be listed: nobody could note that."""

    def __init__(self, values: Mapping[str, float]) -> None:
        self.plain = values
        self.asked: dict[str, None] = {}

    def __getitem__(self, key: str) -> float:
        self.asked[key] = None
        return self.plain[key]

    def get(self, key: str, default: Any = None) -> Any:
        """As a dict's; the mapping's own would raise and catch an error for every effect that is absent."""
        self.asked[key] = None
        return self.plain.get(key, default)

    def __contains__(self, key: object) -> bool:
        self.asked[str(key)] = None
        return key in self.plain

    def __iter__(self) -> Iterator[str]:
        raise TypeError(_BY_NAME)

    def __len__(self) -> int:
        raise TypeError(_BY_NAME)

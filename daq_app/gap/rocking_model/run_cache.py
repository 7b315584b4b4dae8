"""The one cache of the rocking model: what is worked out of a run, kept while nothing it depends on changes.

A fit moves one value at a time, and most parts of a prediction depend on few. What a part depends on is
not declared but seen: it is given its values through a mapping that notes what is asked for. A part that
is a pure function of its values asks for the same ones as long as they are the same, so the note is complete.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping
from typing import Any, Generic, TypeVar, cast

_KEPT = 6
"""Results kept of each part: a fit goes back to its last values after every step of its differences."""
T = TypeVar("T")


class RunCache:
    """What has been worked out of one run; a run that is changed begins with an empty one."""

    def __init__(self) -> None:
        self._constants: dict[Hashable, object] = {}
        self._parts: dict[Hashable, _Part[Any]] = {}

    def constant(self, key: Hashable, make: Callable[[], T]) -> T:
        """What the run alone decides, made once."""
        if key not in self._constants:
            self._constants[key] = make()
        return cast(T, self._constants[key])

    def part(self, key: Hashable, values: Mapping[str, float], make: Callable[[Mapping[str, float]], T]) -> T:
        """What `make` makes of the values; worked out only if something that it asks for is new."""
        if key not in self._parts:
            self._parts[key] = _Part[T]()
        return cast(T, self._parts[key].of(values, make))


class _Part(Generic[T]):
    """The last few results of one part: names asked for, their values, all names where listed, result."""

    def __init__(self) -> None:
        self._known: list[tuple[tuple[str, ...], tuple[float | None, ...], tuple[str, ...] | None, T]] = []

    def of(self, values: Mapping[str, float], make: Callable[[Mapping[str, float]], T]) -> T:
        # A part within another one looks at the plain values; the other one depends on what decided.
        outer = values if isinstance(values, _Watched) else None
        plain = values if outer is None else outer.plain
        get = plain.get
        asked: tuple[str, ...] = ()
        found: tuple[float | None, ...] = ()
        for entry in reversed(self._known):
            keys, given, names, result = entry
            if keys is not asked:  # most entries ask for the same
                asked, found = keys, tuple(map(get, keys))
            if found == given and (names is None or names == tuple(plain)):
                break
        else:
            watched = _Watched(plain)
            result = make(watched)
            new = tuple(watched.asked)
            keys = next((entry[0] for entry in self._known if entry[0] == new), new)
            if len(self._known) >= _KEPT:
                del self._known[0]
            names = tuple(plain) if watched.listed else None
            self._known.append((keys, tuple(map(get, keys)), names, result))
        if outer is not None:
            outer.asked.update(dict.fromkeys(keys))
            outer.listed = outer.listed or names is not None
        return result


class _Watched(Mapping[str, float]):
    """Values that note which of them were asked for."""

    def __init__(self, values: Mapping[str, float]) -> None:
        self.plain = values
        self.asked: dict[str, None] = {}
        self.listed = False
        """Whether the names themselves were asked for."""

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
        self.listed = True
        return iter(self.plain)

    def __len__(self) -> int:
        self.listed = True
        return len(self.plain)

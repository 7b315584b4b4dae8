"""Results kept for as long as nothing that they were made from has changed.

A fit moves one value at a time, and most parts of a prediction depend on few. What a part depends on is
not declared but seen: it is given its values through a mapping that notes what is asked for. A part that
is a pure function of its values asks for the same ones as long as they are the same, so the note is complete.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from daq_app.gap.core.features import FloatArray

_KEPT = 4


class Watched(Mapping[str, float]):
    """Values that note which of them were asked for."""

    def __init__(self, values: Mapping[str, float]) -> None:
        self._values = values
        self.asked: dict[str, None] = {}
        self.listed = False
        """Whether the names themselves were asked for."""

    def __getitem__(self, key: str) -> float:
        self.asked[key] = None
        return self._values[key]

    def get(self, key: str, default: Any = None) -> Any:
        """As a dict's; the mapping's own would raise and catch an error for every effect that is absent."""
        self.asked[key] = None
        return self._values.get(key, default)

    def __contains__(self, key: object) -> bool:
        self.asked[str(key)] = None
        return key in self._values

    def any_of(self, keys: Mapping[str, None]) -> bool:
        """Whether any of the keys is there, all of them noted at once."""
        self.asked.update(keys)
        return not keys.keys().isdisjoint(self._values)

    def __iter__(self) -> Iterator[str]:
        self.listed = True
        return iter(self._values)

    def __len__(self) -> int:
        self.listed = True
        return len(self._values)


def any_of(values: Mapping[str, float], keys: Mapping[str, None]) -> bool:
    """Whether any of the keys has a value; of watched values, all of them count as asked for."""
    return values.any_of(keys) if isinstance(values, Watched) else not keys.keys().isdisjoint(values)


@dataclass(slots=True)
class Memo:
    """The last few results of one part."""

    _known: list[tuple[tuple[str, ...], tuple[float | None, ...], tuple[str, ...] | None, FloatArray]] = (
        field(default_factory=list)
    )

    def of(
        self, values: Mapping[str, float], part: Callable[[Mapping[str, float]], FloatArray]
    ) -> FloatArray:
        """What `part` makes of the values; worked out only if something that it asks for is new."""
        get = values.get
        for keys, given, names, result in reversed(self._known):
            if tuple(map(get, keys)) == given and (names is None or names == tuple(values)):
                return result
        watched = Watched(values)
        result = part(watched)
        keys = tuple(watched.asked)
        if len(self._known) >= _KEPT:
            del self._known[0]
        names = tuple(values) if watched.listed else None
        self._known.append((keys, tuple(map(get, keys)), names, result))
        return result

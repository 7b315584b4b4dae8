"""Desks that are closed after each test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.support.recorder.desk_bench import Counter


@pytest.fixture
def counters() -> Iterator[Callable[..., Counter]]:
    made: list[Counter] = []

    def make(*arguments: Any) -> Counter:
        made.append(Counter(*arguments))
        return made[-1]

    yield make
    for one in made:
        one.close()

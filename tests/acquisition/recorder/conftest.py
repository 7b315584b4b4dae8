"""A recorder on a disk that fails on order."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.recorder.recorder_bench import Bench, Disk


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    return Disk(monkeypatch)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Callable[..., Bench]]:
    made: list[Bench] = []

    def make(spare: Path | None = None, **parts: Any) -> Bench:
        made.append(Bench(tmp_path, spare, **parts))
        return made[-1]

    yield make
    for one in made:
        one.recorder.inbox.put(None)
        one.recorder.join()

"""A simulated device server in this process, with known signals on its terminals."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from tests.support.server_support import Rig, make_rig


@pytest.fixture
def start_rig() -> Iterator[Callable[..., Rig]]:
    """Start servers with chosen clocks; all are stopped at the end."""
    rigs: list[Rig] = []

    def start(**options: object) -> Rig:
        rig = make_rig(**options)
        rigs.append(rig)
        return rig

    yield start
    for rig in rigs:
        rig.close()


@pytest.fixture
def rig(start_rig: Callable[..., Rig]) -> Rig:
    """A server whose time moves with the reads."""
    return start_rig()

"""Shared by all tests: where the repository is, and the rigs that ship with it."""

from __future__ import annotations

from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[1]


@pytest.fixture(scope="session")
def repository() -> Path:
    """Top folder of the checkout."""
    return REPOSITORY


@pytest.fixture(scope="session")
def configs(repository: Path) -> Path:
    """Folder of the shipped rig files."""
    return repository / "configs"


@pytest.fixture(scope="session")
def shared_data(repository: Path) -> Path:
    """Public recordings beside the checkout; tests that need them skip where they are absent."""
    folder = repository.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the public recordings (folder shared/data beside the checkout) are not here")
    return folder

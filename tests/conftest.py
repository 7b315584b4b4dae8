"""Shared by all tests: where the repository is, and the rigs that ship with it."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from hypothesis import settings

# The tests start hundreds of programs. Where no byte code is kept, each compiles all that it imports: for the
# acquisition process alone 1.6 s of the processor.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

pytest.register_assert_rewrite("tests.support")

# No wall clock decides whether a test passes: a busy machine is slow, not wrong. Nor does chance.
settings.register_profile("patient", deadline=None, derandomize=True)
settings.load_profile("patient")

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
try:
    import PySide6.QtWidgets  # noqa: F401 - can Qt start here?

    pytest_plugins = ["pytestqt.plugin"]
except ImportError:
    # A shared library of the system is missing: tests/monitor skips and says which package brings it.
    pytest_plugins = []

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

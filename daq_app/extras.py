"""What is installed only where it is asked for: which extra brings a package, said to whoever misses it."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from typing import Final

EXTRA_OF: Final[Mapping[str, str]] = {
    "PySide6": "window",
    "pyqtgraph": "window",
    "numba": "sim",
    "matplotlib": "report",
    "jinja2": "report",
    "fpdf": "report",
    "pypdf": "report",
    "pyarrow": "formats",
    "xarray": "formats",
    "h5netcdf": "formats",
    "nptdms": "formats",
    "pyuff": "formats",
    "asammdf": "mdf",
    "distributed": "scale",
    "mujoco": "contact",
}
"""Package → extra of this project (`[project.optional-dependencies]` of pyproject.toml)."""


def missing_extra(error: ModuleNotFoundError) -> str | None:
    """What is missing and how to get it; None if the module belongs to no extra."""
    package = (error.name or "").partition(".")[0]
    extra = EXTRA_OF.get(package)
    return None if extra is None else _how_to_get(package, extra)


def absent(extra: str) -> str | None:
    """The first package of an extra that is not installed and how to get it; None if all of them are."""
    missing = [name for name, of in EXTRA_OF.items() if of == extra and find_spec(name) is None]
    return _how_to_get(missing[0], extra) if missing else None


def _how_to_get(package: str, extra: str) -> str:
    return f"this needs the package {package}: python -m pip install 'rocking-test-recorder[{extra}]'"

"""Names of a package that are loaded when they are first used."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any


def at_first_use(
    package: str, places: Mapping[str, Sequence[str]]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """``__getattr__`` and ``__dir__`` of a package; `places`: module below it → the names that it brings."""
    module_of = {name: module for module, names in places.items() for name in names}
    own = vars(sys.modules[package])

    def load(name: str) -> Any:
        if name not in module_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        own[name] = getattr(importlib.import_module(f"{package}.{module_of[name]}"), name)
        return own[name]

    def names() -> list[str]:
        return sorted({*own, *module_of})

    return load, names

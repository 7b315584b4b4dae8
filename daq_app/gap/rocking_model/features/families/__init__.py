"""The sensor families, one file each: every module of this folder holds one as its `FAMILY`."""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module

from daq_app.gap.rocking_model.features.family import SensorFamily


@cache
def sensor_families() -> tuple[SensorFamily, ...]:
    """All families, in the order of their files' names."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    return tuple(import_module(f"{__name__}.{name}").FAMILY for name in names)

"""Families of sensors: those that the rocking analysis reads, and auxiliary ones recorded beside them.

An auxiliary channel is planned, recorded, checked, shown, exported and imported as any other; rocking
analysis and diagnosis leave it out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

Family = Literal[
    "lvdt",
    "wire",
    "accelerometer",
    "tiltmeter",
    "load_cell",
    "strain_gauge",
    "laser",
    "displacement",
    "temperature",
    "voltage",
    "other",
]


@dataclass(frozen=True, slots=True)
class Auxiliary:
    """What is known of an auxiliary family."""

    sensor: str
    """One sensor of the family, with its article."""
    plural: str
    quantity: str
    """What it measures."""
    si_unit: str
    """Empty where each channel names its own unit."""
    zeroed: bool = False
    """Whether a zero is taken with the wall upright: of forces, strains and displacements."""
    travels: bool = False
    """Whether the ends of `range_si` are mechanical or optical stops."""
    diagnosed: bool = False
    """Whether the diagnosis has a sensor family for it: it then is auxiliary no more."""


AUXILIARY: Final[Mapping[str, Auxiliary]] = {
    "load_cell": Auxiliary("a load cell", "load cells", "force", "N", zeroed=True),
    "strain_gauge": Auxiliary("a strain gauge", "strain gauges", "strain", "m/m", zeroed=True),
    "laser": Auxiliary("a laser", "lasers", "displacement", "m", zeroed=True, travels=True),
    "displacement": Auxiliary(
        "a displacement sensor", "displacement sensors", "displacement", "m", zeroed=True, travels=True
    ),
    "temperature": Auxiliary("a thermometer", "thermometers", "temperature", "degC"),
    "voltage": Auxiliary("a voltage", "voltages (trigger, synchronisation, command)", "voltage", "V"),
    "other": Auxiliary("another sensor", "other sensors", "quantity", ""),
}
"""Auxiliary families, and those among the diagnosed that began so, by name; their order is that of lists and
plots."""
FAMILY_NAMES: Final[dict[Family, str]] = {
    "wire": "wires",
    "lvdt": "LVDTs",
    "accelerometer": "accelerometers",
    "tiltmeter": "tiltmeters",
}
"""The reader's word for each family that shows the motion of the wall."""


def is_auxiliary(family: str) -> bool:
    """Whether rocking analysis and diagnosis leave a family out."""
    return family in AUXILIARY and not AUXILIARY[family].diagnosed


def in_a_sentence(target: str) -> str:
    """``lvdt`` → ``the LVDTs``; a channel by its name."""
    return next((f"the {name}" for family, name in FAMILY_NAMES.items() if family == target), target)

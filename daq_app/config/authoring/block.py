"""A wall as a solid rectangular block of one density: what a rig file's [specimen] says of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

_G_M_S2: Final = 9.81
"""As `Specimen.mass_kg` divides."""
DENSITY_KG_M3: Final = 2300.0
"""Stone masonry. Assumed; the weight follows from it where it was not measured."""
_MORTAR_PA: Final = (1.28e6, 0.53e6)
"""Compressive and flexural strength of a lime mortar (Costa et al., section 2): a stand-in."""


@dataclass(frozen=True, slots=True)
class Block:
    """Name and size (m) of a wall; its weight in N, or None where the density tells it."""

    name: str
    height_m: float
    thickness_m: float
    length_m: float
    weight_n: float | None = None

    def table(self) -> dict[str, Any]:
        """Keys of [specimen], SI. I_O = (4/3) m R² and tan α = b/h of a solid block (Housner 1963)."""
        radius = math.hypot(self.thickness_m, self.height_m) / 2
        size_m3 = self.height_m * self.thickness_m * self.length_m
        weight = self.weight_n if self.weight_n is not None else DENSITY_KG_M3 * _G_M_S2 * size_m3
        inertia = 4 / 3 * weight / _G_M_S2 * radius**2
        assumed = ["rotational_inertia_kg_m2", "r0_m", "alpha0_rad", "p_rad_s"]
        assumed += ["mortar_compressive_strength_pa", "mortar_flexural_strength_pa"]
        return {
            "name": self.name,
            "weight_n": _rounded(weight),
            "height_m": self.height_m,
            "rotational_inertia_kg_m2": _rounded(inertia),
            "r0_m": _rounded(radius),
            "alpha0_rad": _rounded(math.atan2(self.thickness_m, self.height_m)),
            "p_rad_s": _rounded(math.sqrt(weight * radius / inertia)),
            "length_m": self.length_m,
            "mortar_compressive_strength_pa": _MORTAR_PA[0],
            "mortar_flexural_strength_pa": _MORTAR_PA[1],
            "source": "daq-app rig new",
            "assumed": assumed if self.weight_n is not None else ["weight_n", *assumed],
        }


def _rounded(value: float) -> float:
    """Six significant digits, so that a wall of a hand's size is as exact as one of a house."""
    return float(f"{value:.6g}")

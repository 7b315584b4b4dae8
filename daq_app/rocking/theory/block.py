"""The wall as a rigid block, and the semi-rigid block whose pivot has moved inwards (2.1 to 2.3)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from daq_app.config.rig import Specimen
from daq_app.rocking.theory import classic as theory

STANDARD_GRAVITY_M_S2 = 9.81
"""The g with which the paper turns weight into mass."""


@dataclass(frozen=True, slots=True)
class SemiRigid:
    """Pivot moved inwards by the crushing of the mortar joint."""

    a_f_m: float
    """Distance of the reaction from the edge, a_f = W / (2 f_m l) (2.3)."""
    a_m: float
    """Inward shift of the pivot, a = 2 a_f."""
    r0_m: float
    """R' = √(h_G² + (b/2 − a)²)."""
    alpha0_rad: float
    """α' = atan((b/2 − a) / h_G)."""
    inertia_kg_m2: float
    """I' = I_G + m R'²."""
    p_rad_s: float
    """p' = √(W R' / I')."""
    r_max: float
    """1 − 2 m R'² sin²α' / I'."""


@dataclass(frozen=True, slots=True)
class RigidBlock:
    """A symmetric block on a rigid base. Raises `ValueError` in words for values no block has."""

    weight_n: float
    r0_m: float
    inertia_kg_m2: float
    """About the base corner."""
    alpha0_rad: float

    def __post_init__(self) -> None:
        theory.frequency_parameter(self.weight_n, self.r0_m, self.inertia_kg_m2)
        theory.r_max_rectangular(self.alpha0_rad)
        if self.inertia_kg_m2 <= self.mass_kg * self.r0_m**2:
            raise ValueError(
                f"the inertia about the corner ({self.inertia_kg_m2:g} kg m²) must exceed m R² = "
                f"{self.mass_kg * self.r0_m**2:g} kg m²: a body has inertia of its own"
            )

    @classmethod
    def from_specimen(cls, specimen: Specimen) -> RigidBlock:
        """The block of a rig file."""
        return cls(
            weight_n=specimen.weight_n,
            r0_m=specimen.r0_m,
            inertia_kg_m2=specimen.rotational_inertia_kg_m2,
            alpha0_rad=specimen.alpha0_rad,
        )

    @classmethod
    def rectangular(cls, base_width_m: float, height_m: float, weight_n: float) -> RigidBlock:
        """A homogeneous rectangular block: R = ½√(b² + h²), I_O = 4/3 m R²."""
        if not (base_width_m > 0 and height_m > 0 and weight_n > 0):
            raise ValueError("base width, height and weight must be positive")
        r0 = math.hypot(base_width_m, height_m) / 2.0
        mass = weight_n / STANDARD_GRAVITY_M_S2
        return cls(weight_n, r0, 4.0 / 3.0 * mass * r0**2, math.atan2(base_width_m, height_m))

    @property
    def mass_kg(self) -> float:
        return self.weight_n / STANDARD_GRAVITY_M_S2

    @property
    def p_rad_s(self) -> float:
        """p = √(W R / I_O)."""
        return float(theory.frequency_parameter(self.weight_n, self.r0_m, self.inertia_kg_m2))

    @property
    def base_width_m(self) -> float:
        """b = 2 R sin α."""
        return 2.0 * self.r0_m * math.sin(self.alpha0_rad)

    @property
    def centroid_height_m(self) -> float:
        """h_G = R cos α."""
        return self.r0_m * math.cos(self.alpha0_rad)

    @property
    def centroid_inertia_kg_m2(self) -> float:
        """I_G = I_O − m R²."""
        return self.inertia_kg_m2 - self.mass_kg * self.r0_m**2

    @property
    def r_max_rectangular(self) -> float:
        """1 − 3/2 sin²α, as the paper uses it (1.2)."""
        return float(theory.r_max_rectangular(self.alpha0_rad))

    @property
    def r_max(self) -> float:
        """1 − 2 m R² sin²α / I_O."""
        return float(theory.r_max_block(self.mass_kg, self.r0_m, self.inertia_kg_m2, self.alpha0_rad))

    def semi_rigid(self, mortar_strength_pa: float, length_m: float) -> SemiRigid:
        """The block on a joint of compressive strength f_m and length l (2.1 to 2.3).

        Raises `ValueError` where the joint is too weak to carry the wall on half its width.
        """
        if not (mortar_strength_pa > 0 and length_m > 0):
            raise ValueError("the mortar's strength and the wall's length must be positive")
        a_f = self.weight_n / (2.0 * mortar_strength_pa * length_m)
        if 2.0 * a_f >= self.base_width_m / 2.0:
            raise ValueError(
                f"the joint would crush over {2 * a_f * 1e3:.0f} mm, more than half the base width "
                f"({self.base_width_m / 2 * 1e3:.0f} mm): the wall cannot stand on it"
            )
        block = self.with_pivots_inside(2.0 * a_f)
        return SemiRigid(
            a_f_m=a_f,
            a_m=2.0 * a_f,
            r0_m=block.r0_m,
            alpha0_rad=block.alpha0_rad,
            inertia_kg_m2=block.inertia_kg_m2,
            p_rad_s=block.p_rad_s,
            r_max=block.r_max,
        )

    def with_pivots_inside(self, inset_m: float) -> RigidBlock:
        """The same body on a base that is narrower by `inset_m` at either edge, less than half its width."""
        half_width = self.base_width_m / 2.0 - inset_m
        radius = math.hypot(self.centroid_height_m, half_width)
        inertia = self.centroid_inertia_kg_m2 + self.mass_kg * radius**2
        return RigidBlock(self.weight_n, radius, inertia, math.atan2(half_width, self.centroid_height_m))

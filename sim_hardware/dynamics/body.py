"""The wall as a rigid block."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from daq_app.config.rig import G_M_S2, Specimen


@dataclass(frozen=True, slots=True)
class Body:
    """A symmetric rigid block that rocks about the two edges of its base (Housner's model).

    `p_rad_s` is √(W R / I_O), with I_O about the edge; gravity enters only through it, and through
    the forces that `mass_kg` gives.
    """

    alpha_rad: float
    p_rad_s: float
    r0_m: float
    """Distance from the edge to the centre of mass."""
    mass_kg: float
    length_m: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 < self.alpha_rad < math.pi / 2:
            raise ValueError(f"alpha_rad must lie between 0 and π/2, not {self.alpha_rad}")
        for name in ("p_rad_s", "r0_m", "mass_kg", "length_m"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be positive, not {getattr(self, name)}")
        if self.gyration_squared_m2 <= 0.0:
            raise ValueError(
                f"p_rad_s = {self.p_rad_s} is too large for r0_m = {self.r0_m}: "
                "the inertia about the centre of mass would not be positive"
            )

    @classmethod
    def from_specimen(cls, specimen: Specimen) -> Body:
        """The block of a rig file; p from W R₀/I_O (Table 3.1 prints it rounded)."""
        moment = specimen.weight_n * specimen.r0_m
        return cls(
            alpha_rad=specimen.alpha0_rad,
            p_rad_s=math.sqrt(moment / specimen.rotational_inertia_kg_m2),
            r0_m=specimen.r0_m,
            mass_kg=specimen.mass_kg,
            length_m=specimen.length_m,
        )

    @property
    def half_base_m(self) -> float:
        """b/2 = R sin α."""
        return self.r0_m * math.sin(self.alpha_rad)

    @property
    def centroid_height_m(self) -> float:
        """h_G = R cos α."""
        return self.r0_m * math.cos(self.alpha_rad)

    @property
    def gyration_squared_m2(self) -> float:
        """I_G/m = g R/p² − R²."""
        return G_M_S2 * self.r0_m / self.p_rad_s**2 - self.r0_m**2

    @property
    def r_max(self) -> float:
        """Upper bound of the restitution of any block: 1 − 2 m R² sin²α / I_O."""
        return 1.0 - 2.0 * self.p_rad_s**2 * self.r0_m * math.sin(self.alpha_rad) ** 2 / G_M_S2

    def with_pivot_moved(self, inwards_m: float) -> Body:
        """The block that turns about points `inwards_m` inside its edges (Eqns 2.1 to 2.3)."""
        half, height = self.half_base_m - inwards_m, self.centroid_height_m
        if half <= 0.0:
            raise ValueError(f"the pivot cannot move by {inwards_m} m: the half base is {self.half_base_m} m")
        radius = math.hypot(half, height)
        p = math.sqrt(G_M_S2 * radius / (self.gyration_squared_m2 + radius**2))
        return replace(self, alpha_rad=math.atan2(half, height), p_rad_s=p, r0_m=radius)


def crushed_width_m(specimen: Specimen) -> float:
    """a = 2 a_f with a_f = W / (2 f_m l): how far the semi-rigid pivot lies inside the edge (Eqn 2.1)."""
    return specimen.weight_n / (specimen.mortar_compressive_strength_pa * specimen.length_m)

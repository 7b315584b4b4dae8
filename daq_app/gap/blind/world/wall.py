"""The true wall behind a case: the specimen of the rig file, off by what a survey is off."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from daq_app.config.rig import Specimen

GRAVITY_M_S2 = 9.81
"""As in the weights of Table 3.1 (mass = weight / 9.81)."""


@dataclass(frozen=True, slots=True)
class Wall:
    """A rigid block that rocks about its two lower edges.

    Lengths in metres; `inertia_cg` about the centre of mass; `restitution` is the ratio of angular
    velocities at an impact and `restitution_scatter` its relative standard deviation.
    """

    mass_kg: float
    half_width: float
    centroid_height: float
    inertia_cg: float
    height: float
    length: float
    restitution: float
    restitution_scatter: float

    def inertia_about(self, arm: float) -> float:
        """Moment of inertia about an edge at horizontal distance `arm` of the centroid (Steiner)."""
        return self.inertia_cg + self.mass_kg * (arm * arm + self.centroid_height**2)

    @property
    def alpha(self) -> float:
        return math.atan2(self.half_width, self.centroid_height)

    @property
    def p(self) -> float:
        """p² = m g R / I_O."""
        radius = math.hypot(self.half_width, self.centroid_height)
        return math.sqrt(self.mass_kg * GRAVITY_M_S2 * radius / self.inertia_about(self.half_width))

    @classmethod
    def nominal(cls, specimen: Specimen, restitution: float) -> Wall:
        """The wall exactly as surveyed, whose restitution does not scatter."""
        mass = specimen.weight_n / GRAVITY_M_S2
        return cls(
            mass_kg=mass,
            half_width=specimen.base_width_m / 2.0,
            centroid_height=specimen.centroid_height_m,
            inertia_cg=specimen.rotational_inertia_kg_m2 - mass * specimen.r0_m**2,
            height=specimen.height_m,
            length=specimen.length_m,
            restitution=restitution,
            restitution_scatter=0.0,
        )


def draw_wall(specimen: Specimen, rng: np.random.Generator) -> Wall:
    """A wall whose survey was off by a per cent or two, with a restitution of its own.

    Impact scatter 0.2 to 0.8 %, log-uniform: real walls do not repeat r.
    """
    surveyed = Wall.nominal(specimen, 1.0)
    alpha = surveyed.alpha
    r_max = 1.0 - 1.5 * math.sin(alpha) ** 2
    return Wall(
        mass_kg=surveyed.mass_kg * (1.0 + 0.005 * rng.standard_normal()),
        half_width=surveyed.half_width * (1.0 + 0.008 * rng.standard_normal()),
        centroid_height=surveyed.centroid_height * (1.0 + 0.008 * rng.standard_normal()),
        inertia_cg=surveyed.inertia_cg * (1.0 + 0.03 * rng.standard_normal()),
        height=surveyed.height,
        length=surveyed.length,
        restitution=float(r_max * rng.uniform(0.95, 1.025)),
        restitution_scatter=float(np.exp(rng.uniform(math.log(0.002), math.log(0.008)))),
    )


def off_survey(wall: Wall, specimen: Specimen, sizes: Mapping[str, float]) -> Wall:
    """The wall with errors of its survey `survey` times larger, and with an impact scatter of its own."""
    surveyed = Wall.nominal(specimen, 1.0)
    times = sizes.get("survey", 1.0)
    height = surveyed.centroid_height
    return replace(
        wall,
        centroid_height=height + times * (wall.centroid_height - height),
        inertia_cg=surveyed.inertia_cg + times * (wall.inertia_cg - surveyed.inertia_cg),
        restitution_scatter=sizes.get("impact_scatter", wall.restitution_scatter),
    )

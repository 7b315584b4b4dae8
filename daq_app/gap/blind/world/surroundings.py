"""What a laboratory makes of a case, beside the wall and its effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from daq_app.config import Rig
from daq_app.gap.blind.world.laboratories.numerics import Numerics
from daq_app.gap.blind.world.laboratories.table import Chain, Laboratory
from daq_app.gap.blind.world.sensors.installation import Installation, draw_installation
from daq_app.gap.blind.world.shock import Shock, draw_shock


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Everything that a laboratory decides for one case; the defaults are those of `own`."""

    laboratory: str = "own"
    chain: Chain = "own"
    sizes: Mapping[str, float] = field(default_factory=dict)
    """Imperfection → its size."""
    numerics: Numerics = field(default_factory=Numerics)
    shock: Shock = field(default_factory=Shock)
    installation: Installation | None = None
    """None where everything stands as the rig file says."""


def draw_surroundings(
    laboratory: Laboratory, rig: Rig, sizes: Mapping[str, float], rng: np.random.Generator
) -> Surroundings:
    """Surroundings with imperfections of these sizes."""
    form = laboratory.shocks[int(rng.integers(len(laboratory.shocks)))]
    return Surroundings(
        laboratory=laboratory.name,
        chain=laboratory.chain,
        sizes=sizes,
        numerics=laboratory.numerics.draw(rng),
        shock=draw_shock(form, sizes["impact_shock"], rng) if "impact_shock" in sizes else Shock(),
        installation=draw_installation(rig, sizes, rng),
    )

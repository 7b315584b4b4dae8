"""What real walls do that a rigid block with one r does not: effects of the simulator in two sizes each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from daq_app.config import Rig
from studies.restitution.laboratory import LaboratoryTest, draw_test

_SLOWEST_RAD_S: Final = 0.02
"""Slower impacts are lost in the noise: r of a test is not theirs."""
_CHANGES_R: Final = ("restitution_slope", "restitution_wear")
"""Effects by which r goes from one value to another within a test, so that none is its r. A scatter is none
of them: r is then the mean that the impacts are drawn about, as it is of every sound test."""


@dataclass(frozen=True, slots=True)
class Wall:
    """One effect of the simulator; the size is that of its first parameter, in its unit."""

    effect: str
    parameters: Mapping[str, float]
    ends_s: float | None = None
    """How long after the last impact the recording ends; as the rig file says if None."""

    def test(self, rig: Rig, seed: int) -> LaboratoryTest:
        """The laboratory of `seed` with this wall."""
        test = draw_test(rig, seed, effects={self.effect: self.parameters} if self.effect else {})
        if self.ends_s is None:
            return test
        end = round((test.truth["impact_time_s"][-1] + self.ends_s) * test.rate_hz)
        return replace(test, si=test.si[:, :end])

    @property
    def changes_r(self) -> bool:
        """Whether r of the test is the mean of its impacts; the sound tests beside it count by the same."""
        return self.effect in _CHANGES_R

    @property
    def name(self) -> str:
        """For a table."""
        told = ", ".join(f"{key} {value:g}" for key, value in self.parameters.items())
        ends = "" if self.ends_s is None else f", ends {self.ends_s:g} s"
        return f"{self.effect} {told}{ends}" if self.effect else "rigid block"


def ringing_test(rig: Rig, seed: int) -> LaboratoryTest:
    """A wall that bends, drawn by `seed` with its laboratory, whose recording ends before it stands still.

    Its mode rings at 2.5 to 9 Hz for 1 to 20 s.
    """
    rng = np.random.default_rng([seed, 1])
    parameters = {
        "gain": float(np.exp(rng.uniform(np.log(0.01), np.log(0.3)))),
        "frequency": float(rng.uniform(2.5, 9.0)),
        "zeta": float(np.exp(rng.uniform(np.log(0.003), np.log(0.02)))),
    }
    return Wall("flexible_wall", parameters, ends_s=float(rng.uniform(0.4, 1.5))).test(rig, seed)


def mean_r_of_impacts(test: LaboratoryTest) -> float:
    """Mean of |speed after| / |speed before| over the impacts that are not lost in the noise."""
    before = np.abs(test.truth["velocity_before_rad_s"])
    after = np.abs(test.truth["velocity_after_rad_s"])
    counted = before > _SLOWEST_RAD_S
    return float(np.mean(after[counted] / before[counted]))


WALLS = (
    Wall("", {}),
    *(Wall("coulomb", {"mu": size}) for size in (0.005, 0.02)),
    *(Wall("viscous", {"zeta": size}) for size in (0.005, 0.02)),
    *(Wall("restitution_slope", {"k": size}) for size in (0.02, 0.05)),
    *(Wall("restitution_asymmetry", {"d": size}) for size in (0.01, 0.02)),
    *(Wall("restitution_wear", {"loss": size}) for size in (0.002, 0.01)),
    *(Wall("restitution_scatter", {"sigma": size}) for size in (0.01, 0.02)),
    *(Wall("winkler", {"theta_c": size}) for size in (2e-4, 9e-4)),
    *(Wall("rounded_edge", {"rho": size}) for size in (0.02, 0.1)),
    *(Wall("pivot_shift", {"a": size}) for size in (0.01, 0.033)),
    *(Wall("base_tilt", {"beta": size}) for size in (0.001, 0.004)),
    *(Wall("bounce", {"tau": size}) for size in (0.002, 0.008)),
    *(Wall("dwell", {"tau": size}) for size in (0.002, 0.008)),
    *(Wall("compliance", {"phi": size}) for size in (0.0005, 0.002)),
    *(Wall("flexible_wall", {"gain": size}) for size in (0.001, 0.005)),
    *(
        Wall("flexible_wall", {"gain": size, "frequency": 4.6, "zeta": 0.005}, ends_s=0.7)
        for size in (0.02, 0.2)
    ),
    *(Wall("twist", {"kick": size}) for size in (0.01, 0.05)),
    *(Wall("residual_cable", {"k": size}) for size in (0.01, 0.05)),
    *(Wall("slow_release", {"tau": size}) for size in (0.02, 0.1)),
)

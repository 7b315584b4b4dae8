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
class SimulatedEffect:
    """One effect of the simulator, on the wall or on sensors; the size is that of its first parameter."""

    effect: str
    parameters: Mapping[str, float]
    ends_s: float | None = None
    """How long after the last impact the recording ends; as the rig file says if None."""

    def test(self, rig: Rig, seed: int) -> LaboratoryTest:
        """The laboratory of `seed` with this effect."""
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
    return SimulatedEffect("flexible_wall", parameters, ends_s=float(rng.uniform(0.4, 1.5))).test(rig, seed)


def mean_r_of_impacts(test: LaboratoryTest) -> float:
    """Mean of |speed after| / |speed before| over the impacts that are not lost in the noise."""
    before = np.abs(test.truth["velocity_before_rad_s"])
    after = np.abs(test.truth["velocity_after_rad_s"])
    counted = before > _SLOWEST_RAD_S
    return float(np.mean(after[counted] / before[counted]))


WALLS = (
    SimulatedEffect("", {}),
    *(SimulatedEffect("coulomb", {"mu": size}) for size in (0.005, 0.02)),
    *(SimulatedEffect("viscous", {"zeta": size}) for size in (0.005, 0.02)),
    *(SimulatedEffect("restitution_slope", {"k": size}) for size in (0.02, 0.05)),
    *(SimulatedEffect("restitution_asymmetry", {"d": size}) for size in (0.01, 0.02)),
    *(SimulatedEffect("restitution_wear", {"loss": size}) for size in (0.002, 0.01)),
    *(SimulatedEffect("restitution_scatter", {"sigma": size}) for size in (0.01, 0.02)),
    *(SimulatedEffect("winkler", {"theta_c": size}) for size in (2e-4, 9e-4)),
    *(SimulatedEffect("rounded_edge", {"rho": size}) for size in (0.02, 0.1)),
    *(SimulatedEffect("pivot_shift", {"a": size}) for size in (0.01, 0.033)),
    *(SimulatedEffect("base_tilt", {"beta": size}) for size in (0.001, 0.004)),
    *(SimulatedEffect("bounce", {"tau": size}) for size in (0.002, 0.008)),
    *(SimulatedEffect("dwell", {"tau": size}) for size in (0.002, 0.008)),
    *(SimulatedEffect("compliance", {"phi": size}) for size in (0.0005, 0.002)),
    *(SimulatedEffect("flexible_wall", {"gain": size}) for size in (0.001, 0.005)),
    *(
        SimulatedEffect("flexible_wall", {"gain": size, "frequency": 4.6, "zeta": 0.005}, ends_s=0.7)
        for size in (0.02, 0.2)
    ),
    *(SimulatedEffect("twist", {"kick": size}) for size in (0.01, 0.05)),
    *(SimulatedEffect("residual_cable", {"k": size}) for size in (0.01, 0.05)),
    *(SimulatedEffect("taut_cable", {"k": size, "loose": 0.05}) for size in (0.01, 0.05)),
    *(SimulatedEffect("slow_release", {"tau": size}) for size in (0.02, 0.1)),
    *(SimulatedEffect("crushing", {"loss": size}) for size in (0.01, 0.03)),
    *(SimulatedEffect("quadratic_drag", {"c": size}) for size in (0.02, 0.1)),
    *(SimulatedEffect("alpha_asymmetry", {"delta": size}) for size in (0.002, 0.005)),
    *(SimulatedEffect("eccentric_mass", {"e": size}) for size in (0.002, 0.007)),
    *(SimulatedEffect("cubic", {"kappa": size}) for size in (0.1, 0.3)),
    *(SimulatedEffect("sliding", {"c": size}) for size in (0.002, 0.02)),
    *(SimulatedEffect("sliding_on", {"c": size}) for size in (0.002, 0.01)),
    *(SimulatedEffect("corner_twist", {"c": size}) for size in (0.002, 0.006)),
    *(SimulatedEffect("yaw", {"kick": size}) for size in (0.01, 0.05)),
    *(SimulatedEffect("initial_velocity", {"omega": size}) for size in (0.01, 0.03)),
    *(SimulatedEffect("ambient", {"amplitude": size}) for size in (0.05, 0.3)),
)

"""The wall of a rig file, and one release test of it with its truth."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Rig
from sim_hardware.dynamics import Body, Motion, Release, Restitution
from sim_hardware.dynamics import parameters as par
from sim_hardware.dynamics.body import crushed_width_m
from sim_hardware.dynamics.motion import motion_vector, simulate_vector
from sim_hardware.library import split_effects
from sim_hardware.sensors.noise import generator, key_of

DURATION_S = 120.0
"""Longest motion after a release."""

Effects = Mapping[str, Mapping[str, float]]
Engine = Callable[[NDArray[np.float64], NDArray[np.float64]], Motion]
"""From kernel parameters and the deviates of r of the impacts, (n,) or none, to the motion."""


@dataclass(frozen=True, slots=True)
class SimulatedTest:
    """One release and what followed; times in seconds since power-on."""

    number: int
    release_s: float
    planned_rad: float
    motion: Motion
    effects: dict[str, dict[str, float]]
    interrupted_s: float = math.inf
    """When somebody caught the wall."""

    def interrupted(self, time_s: float) -> SimulatedTest:
        """The same test, whose impacts after `time_s` do not happen."""
        return self if time_s >= self.interrupted_s else replace(self, interrupted_s=time_s)

    @property
    def rest_s(self) -> float:
        """When the wall came to rest; NaN if it did not, or was caught before."""
        rest = self.release_s + self.motion.rest_s
        return rest if rest < self.interrupted_s else math.nan

    def truth(self) -> dict[str, object]:
        """Everything that an analysis may be compared with; plain numbers, ready for JSON."""
        vector, motion = self.motion.vector, self.motion
        happened = motion.impact_time_s + self.release_s < self.interrupted_s
        return {
            "test": self.number,
            "release_s": self.release_s,
            "theta0_rad": motion.theta0_rad,
            "theta0_over_alpha": motion.theta0_rad / float(vector[par.ALPHA]),
            "planned_theta0_rad": self.planned_rad,
            "restitution": float(vector[par.RESTITUTION]),
            "restitution_scatter": float(vector[par.SCATTER]),
            "alpha_rad": float(vector[par.ALPHA]),
            "p_rad_s": float(vector[par.P]),
            "impacts_before": int(vector[par.IMPACTS_BEFORE]),
            "impact_time_s": (motion.impact_time_s[happened] + self.release_s).tolist(),
            "velocity_before_rad_s": motion.velocity_before_rad_s[happened].tolist(),
            "velocity_after_rad_s": motion.velocity_after_rad_s[happened].tolist(),
            "impact_kind": motion.impact_kind[happened].tolist(),
            "peak_time_s": (motion.peak_time_s + self.release_s).tolist(),
            "peak_rotation_rad": motion.peak_rotation_rad.tolist(),
            "ending": motion.ending,
            "rest_s": None if math.isnan(self.rest_s) else self.rest_s,
            "effects": self.effects,
        }


@dataclass(frozen=True, slots=True)
class Wall:
    """The wall behind a rig file: its body, its true restitution and the effects that act on it."""

    body: Body
    restitution: Restitution
    theta0_scatter: float
    seed: int
    impacts_before: int
    motion_effects: dict[str, dict[str, float]]
    sensor_effects: dict[str, dict[str, float]]
    engine: Engine = simulate_vector
    """What moves it."""

    @classmethod
    def of(
        cls,
        rig: Rig,
        seed: int,
        restitution: float | None,
        effects: Effects,
        impacts_before: int = 0,
        engine: Engine = simulate_vector,
    ) -> Wall:
        """`effects` and `restitution` go over those of the rig's `simulation` table."""
        simulation = rig.simulation
        merged = {**simulation.effects, **{key: dict(values) for key, values in effects.items()}}
        motion, sensor = split_effects(merged)
        if simulation.semi_rigid:
            motion.setdefault("pivot_shift", {"a": crushed_width_m(rig.specimen)})
        return cls(
            Body.from_specimen(rig.specimen),
            Restitution(
                simulation.restitution if restitution is None else restitution,
                simulation.restitution_scatter,
            ),
            simulation.theta0_scatter,
            seed,
            impacts_before,
            motion,
            sensor,
            engine,
        )

    def vector(
        self, release: Release | None = None, earlier: int = 0, r: float | None = None
    ) -> NDArray[np.float64]:
        """Kernel parameters of a release after `earlier` further impacts; upright where None."""
        rule = self.restitution if r is None else replace(self.restitution, r=r)
        return motion_vector(
            self.body,
            release or Release(0.0),
            rule,
            self.motion_effects,
            duration_s=DURATION_S,
            impacts_before=self.impacts_before + earlier,
        )

    def check_level(self, theta0_over_alpha: float) -> None:
        """`ValueError` in words where the wall cannot be released from that level."""
        if not 0.01 <= abs(theta0_over_alpha) <= 0.95:
            raise ValueError(
                f"the level θ0/α must lie between 0.01 and 0.95 (either sign), not {theta0_over_alpha:g}: "
                "the wall would not rock, or fall over"
            )

    def release_rotation(self, level: float, pull: int) -> float:
        """The rotation that the pull numbered `pull` really reaches, rad."""
        scatter = generator(self.seed, f"pull {pull}", "theta0").standard_normal() * self.theta0_scatter
        return level * self.body.alpha_rad * (1.0 + float(np.clip(scatter, -0.05, 0.05)))

    def release(
        self,
        at_s: float,
        theta_rad: float,
        omega_rad_s: float,
        pull: int,
        earlier_impacts: int,
        restitution: float | None,
        planned_rad: float | None = None,
    ) -> SimulatedTest:
        """Let go a wall that is at `theta_rad` and moving at `omega_rad_s`."""
        vector = self.vector(Release(theta_rad), earlier_impacts, restitution)
        vector[par.OMEGA0] += math.copysign(1.0, theta_rad) * omega_rad_s
        # the floor vibrates on whatever the wall does: its phase in the vector is that at release
        vector[par.AMBIENT_PHASE] += 2.0 * math.pi * vector[par.AMBIENT_HZ] * at_s
        seed = int(key_of(self.seed, f"pull {pull}", "impacts"))
        scattered = vector[par.SCATTER] != 0.0
        deviates = Restitution(1.0, seed=seed).deviates(4096) if scattered else np.empty(0)
        motion = self.engine(vector, deviates)
        effects = {**self.motion_effects, **self.sensor_effects}
        planned = theta_rad if planned_rad is None else planned_rad
        return SimulatedTest(pull, at_s, planned, motion, effects)

"""Simulated motions: from body, release, restitution and effects to exact impacts and θ(t) at any time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from sim_hardware.dynamics import kernel
from sim_hardware.dynamics import parameters as par
from sim_hardware.dynamics import pieces as pc
from sim_hardware.dynamics.body import Body
from sim_hardware.dynamics.effects import apply_motion_effects

_NO_EFFECTS: Final[Mapping[str, Mapping[str, float]]] = {}
_EMPTY: Final = np.empty(0)
_MAX_IMPACTS: Final = 200_000
_N_DEVIATES: Final = 4096
Ending = Literal["at rest", "duration over", "overturned"]
_ENDINGS: Final[dict[int, Ending]] = {
    kernel.AT_REST: "at rest",
    kernel.DURATION_OVER: "duration over",
    kernel.OVERTURNED: "overturned",
}


@dataclass(frozen=True, slots=True)
class Release:
    """How the wall is let go at t = 0."""

    theta0_rad: float
    """Rotation at which it is held; the sign is the side."""


@dataclass(frozen=True, slots=True)
class Restitution:
    """θ̇⁺ = r θ̇⁻, with relative scatter from impact to impact."""

    r: float
    scatter: float = 0.0
    """Relative standard deviation of r."""
    seed: int = 0

    def deviates(self, n: int) -> NDArray[np.float64]:
        """(n,) standard normal deviates by impact, the same for the same seed."""
        return np.random.Generator(np.random.Philox(key=self.seed)).standard_normal(n)


@dataclass(frozen=True, slots=True)
class Motion:
    """A motion from release (t = 0) to rest, with θ, θ̇, θ̈ at any time.

    Impacts are in order of time; `impact_kind` is 1 for the second impact of a bounce, else 0.
    Peaks are the turning points: the release first, then one per half-cycle.
    """

    vector: NDArray[np.float64]
    """The kernel parameters it was made with."""
    pieces: NDArray[np.float64]
    """(m, 19) polynomial pieces (sim_hardware.dynamics.pieces)."""
    impact_time_s: NDArray[np.float64]
    velocity_before_rad_s: NDArray[np.float64]
    """θ̇⁻, signed."""
    velocity_after_rad_s: NDArray[np.float64]
    impact_kind: NDArray[np.int64]
    peak_time_s: NDArray[np.float64]
    peak_rotation_rad: NDArray[np.float64]
    ending: Ending
    end_s: float
    """When it came to rest, overturned, or was cut by the duration."""

    @property
    def rest_s(self) -> float:
        """Time of rest; NaN if it did not come to rest."""
        return self.end_s if self.ending == "at rest" else float("nan")

    @property
    def theta0_rad(self) -> float:
        return float(self.vector[par.THETA0])

    def rotation(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """θ, rad, at `times_s` (any shape, fast if ascending); θ₀ before release, the last after the end."""
        return self._evaluate(times_s, 1)[0]

    def velocity(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """θ̇, rad/s; at an impact the value after it."""
        return self._evaluate(times_s, 2)[1]

    def acceleration(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """θ̈ between impacts, rad/s² (the impulses at impacts are in the velocities before and after)."""
        return self._evaluate(times_s, 3)[2]

    def evaluate(
        self, times_s: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """(θ, θ̇, θ̈), rad and s, at `times_s`; each has the shape of the times."""
        rotation, velocity, acceleration = self._evaluate(times_s, 3)
        return rotation, velocity, acceleration

    def _evaluate(self, times_s: NDArray[np.float64], n: int) -> tuple[NDArray[np.float64], ...]:
        times = np.ascontiguousarray(times_s, dtype=np.float64)
        flat = times.reshape(-1)
        outputs = [np.empty(flat.size) if k < n else _EMPTY for k in range(3)]
        pc.evaluate(self.pieces, flat, *outputs)
        return tuple(out.reshape(times.shape) if out.size else out for out in outputs)


def simulate_vector(vector: NDArray[np.float64], deviates: NDArray[np.float64] = _EMPTY) -> Motion:
    """The motion of a flat vector (sim_hardware.dynamics.parameters); grows its tables as needed."""
    n_pieces, n_impacts = 512, 256
    while True:
        pieces = np.empty((n_pieces, pc.N_COLUMNS))
        impacts = np.empty((n_impacts, kernel.N_IMPACT_COLUMNS))
        peaks = np.empty((n_impacts, kernel.N_PEAK_COLUMNS))
        used, hits, turns, ending, end_s = kernel.integrate(vector, deviates, pieces, impacts, peaks)
        if ending != kernel.TABLE_FULL:
            break
        if n_impacts >= _MAX_IMPACTS:
            raise ValueError(
                f"more than {n_impacts} impacts: raise the rest amplitude or shorten the duration "
                f"({vector[par.REST_AMPLITUDE]:g} rad, {vector[par.DURATION]:g} s)"
            )
        n_pieces, n_impacts = 4 * n_pieces, 4 * n_impacts
    return Motion(
        vector=vector.copy(),
        pieces=pieces[:used].copy(),
        impact_time_s=impacts[:hits, kernel.I_TIME].copy(),
        velocity_before_rad_s=impacts[:hits, kernel.I_BEFORE].copy(),
        velocity_after_rad_s=impacts[:hits, kernel.I_AFTER].copy(),
        impact_kind=impacts[:hits, kernel.I_KIND].astype(np.int64),
        peak_time_s=peaks[:turns, 0].copy(),
        peak_rotation_rad=peaks[:turns, 1].copy(),
        ending=_ENDINGS[ending],
        end_s=end_s,
    )


def motion_vector(
    body: Body,
    release: Release,
    restitution: Restitution,
    effects: Mapping[str, Mapping[str, float]] = _NO_EFFECTS,
    *,
    duration_s: float = 30.0,
    impacts_before: float = 0.0,
    rest_amplitude_rad: float = par.REST_AMPLITUDE_RAD,
) -> NDArray[np.float64]:
    """The kernel's parameter vector; `ValueError` in words for values that make no sense."""
    if not 0.0 <= restitution.r <= 1.0:
        raise ValueError(f"restitution must lie within 0 and 1, not {restitution.r}")
    if abs(release.theta0_rad) >= body.alpha_rad:
        raise ValueError(f"a wall released at {release.theta0_rad} rad falls over: α = {body.alpha_rad} rad")
    vector = par.base_vector(body)
    vector[par.RESTITUTION] = restitution.r
    vector[par.SCATTER] = restitution.scatter
    vector[par.THETA0] = release.theta0_rad
    vector[par.DURATION] = duration_s
    vector[par.IMPACTS_BEFORE] = impacts_before
    vector[par.REST_AMPLITUDE] = rest_amplitude_rad
    apply_motion_effects(vector, effects)
    return vector


def simulate_motion(
    body: Body,
    release: Release,
    restitution: Restitution,
    effects: Mapping[str, Mapping[str, float]] = _NO_EFFECTS,
    *,
    duration_s: float = 30.0,
    impacts_before: float = 0.0,
    rest_amplitude_rad: float = par.REST_AMPLITUDE_RAD,
) -> Motion:
    """Nonlinear two-sided Housner motion after a release, with `effects` (name → parameters, SI) as terms.

    The wall is at rest when the energy left after an impact would not lift it to
    `rest_amplitude_rad`; the motion is cut at `duration_s`.  `impacts_before` counts the impacts of
    earlier tests, for effects that wear.  `ValueError` in words for values that make no sense.
    """
    vector = motion_vector(
        body,
        release,
        restitution,
        effects,
        duration_s=duration_s,
        impacts_before=impacts_before,
        rest_amplitude_rad=rest_amplitude_rad,
    )
    scattered = vector[par.SCATTER] != 0.0
    return simulate_vector(vector, restitution.deviates(_N_DEVIATES) if scattered else _EMPTY)

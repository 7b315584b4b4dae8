"""A wall on points that press and give way: rigid-body contact dynamics, no equation of the analysis.

A rigid body in its plane (x, z, θ) stands on points along a strip at each edge. A point that is below the
ground is pushed up by a spring and a dashpot, never pulled down, and held along x by another pair; where
the weight rests within a strip is what comes of it. scipy's LSODA integrates it from contact to contact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from daq_app.config.rig import G_M_S2
from sim_hardware.dynamics import Body, Motion
from sim_hardware.dynamics import parameters as par
from sim_hardware.dynamics import pieces as pc

Floats = NDArray[np.float64]

_POINTS: Final = 13
_DAMPING: Final = 0.3
"""Damping ratio of the wall's bounce on the points of one edge: it loses r of a plastic impact, and hardly
leaves the ground."""
_LONGEST_STEP_S: Final = 4e-3
_TURNING_S: Final = 5.0
"""Longest time of a half-cycle, s: a wall that stays to one side for longer has come to rest."""
_STILL_RAD_S: Final = 3e-3
"""Speed at an impact below which the wall is taken to stand: a peak of 0.005 mrad follows."""
_SHORTEST_PIECE_S: Final = 2.5e-4


@dataclass(frozen=True, slots=True)
class StripWall:
    """A body per unit of mass on a strip of points at each edge; `width_m` of 0 is one point, the edge."""

    body: Body
    width_m: float
    stiffness_1_s2: float
    """Of all points of one edge together, over the mass."""

    def _places(self) -> Floats:
        """x of each point from the middle of the base, (points,), m."""
        inside = np.linspace(0.0, self.width_m, _POINTS if self.width_m > 0.0 else 1)
        at = self.body.half_base_m - inside
        return np.concatenate((-at[::-1], at))

    def slopes(self, _: float, state: Floats) -> list[float]:
        """Rates of (x, z, θ, ẋ, ż, θ̇), m, rad and s, (6,)."""
        x, z, theta, vx, vz, omega = state
        places, height = self._places(), self.body.centroid_height_m
        of_one = self.stiffness_1_s2 / (places.size / 2)
        dashpot = 2.0 * _DAMPING * math.sqrt(self.stiffness_1_s2) / (places.size / 2)
        sin, cos = math.sin(theta), math.cos(theta)
        along, up = -places * sin - height * cos, height * sin - places * cos
        depth = places * sin + height * cos - z
        touches = depth > 0.0
        normal = np.maximum(of_one * depth - dashpot * (vz + up * omega), 0.0) * touches
        moved = x + places * cos - height * sin - places
        shear = -(of_one * moved + dashpot * (vx + along * omega)) * touches
        turning = float(normal @ up + shear @ along) / self.body.gyration_squared_m2
        return [vx, vz, omega, float(shear.sum()), float(normal.sum()) - G_M_S2, turning]

    def held_at(self, theta_rad: float) -> Floats:
        """The state at rest at this rotation, (6,): points of one edge carry the weight, without shear."""
        places, height = self._places(), self.body.centroid_height_m
        sin, cos = math.sin(theta_rad), math.cos(theta_rad)
        of_one = self.stiffness_1_s2 / (places.size / 2)

        def left_over(z: float) -> float:
            depth = np.maximum(places * sin + height * cos - z, 0.0)
            return float(of_one * depth.sum()) - G_M_S2

        free = height * cos + self.body.half_base_m * abs(sin)
        z = brentq(left_over, free - 1e-3, free, xtol=1e-14)
        bearing = places[places * sin + height * cos > z]
        return np.array([height * sin + (1.0 - cos) * bearing.mean(), z, theta_rad, 0.0, 0.0, 0.0])

    def energy(self, state: Floats) -> float:
        """Mechanical energy over the mass, m²/s²."""
        _, z, theta, vx, vz, omega = (float(value) for value in state)
        places, height = self._places(), self.body.centroid_height_m
        depth = np.maximum(places * math.sin(theta) + height * math.cos(theta) - z, 0.0)
        spring = 0.5 * self.stiffness_1_s2 / (places.size / 2) * float(depth @ depth)
        moving = 0.5 * (vx**2 + vz**2 + self.body.gyration_squared_m2 * omega**2)
        return moving + G_M_S2 * z + spring


def stiffness_of(width_m: float, lift_rad: float) -> float:
    """Stiffness over the mass, 1/s², of an edge whose strip lifts at its inner end at `lift_rad`."""
    return 2.0 * G_M_S2 / (lift_rad * width_m)


def contact_motion(vector: Floats, deviates: Floats, *, width_m: float, stiffness_1_s2: float) -> Motion:
    """The motion after a release, of a kernel vector (N_PARAMETERS,) and deviates of r of the impacts.

    At each passage through θ = 0 all speeds are cut by the drawn r over that of a plastic impact, which the
    contacts make by themselves. `velocity_before_rad_s` and after are those of a rigid block about its edge
    with the energy at the peaks before and after the passage.
    """
    body = Body(vector[par.ALPHA], vector[par.P], vector[par.R0], 1.0)
    wall = StripWall(body, width_m, stiffness_1_s2)
    upright = wall.energy(wall.held_at(1e-9))
    state, start = wall.held_at(vector[par.THETA0]), 0.0
    times, courses = [np.array([0.0])], [state[:, None]]
    impacts: list[float] = []
    peaks, energies = [(0.0, float(vector[par.THETA0]))], [wall.energy(state) - upright]
    while not impacts or abs(state[5]) > _STILL_RAD_S:
        side = math.copysign(1.0, state[2] if not impacts else state[5])
        found = _half_cycle(wall, state, start, side)
        if found is None:
            break
        times.append(found[0][1:])
        courses.append(found[1][:, 1:])
        start, state = float(found[0][-1]), found[1][:, -1].copy()
        if impacts:
            top = int(np.argmax(side * found[1][2]))
            peaks.append((float(found[0][top]), float(found[1][2, top])))
            energies.append(wall.energy(found[1][:, top]) - upright)
        impacts.append(start)
        deviate = float(deviates[len(impacts) - 1]) if deviates.size else 0.0
        wanted = vector[par.RESTITUTION] * (1.0 + vector[par.SCATTER] * deviate)
        state[3:] *= min(wanted / body.r_max, 1.0)
    speeds = np.sqrt(2.0 * np.maximum(energies, 0.0) / (body.gyration_squared_m2 + body.r0_m**2))
    signs = -np.sign([theta for _, theta in peaks])
    happened = len(peaks) - 1
    pieces = _pieces(np.concatenate(times), np.hstack(courses), start)
    return Motion(
        vector=vector.copy(),
        pieces=pieces,
        impact_time_s=np.array(impacts[:happened]),
        velocity_before_rad_s=(signs * speeds)[:happened],
        velocity_after_rad_s=signs[:happened] * speeds[1 : happened + 1],
        impact_kind=np.zeros(happened, dtype=np.int64),
        peak_time_s=np.array([at for at, _ in peaks]),
        peak_rotation_rad=np.array([theta for _, theta in peaks]),
        ending="at rest",
        end_s=start,
    )


def _half_cycle(wall: StripWall, state: Floats, start_s: float, side: float) -> tuple[Floats, Floats] | None:
    """Instants (n,) and states (6, n) until θ passes through 0; None for a wall that stays to one side."""

    def through_zero(_: float, state: Floats) -> float:
        return side * float(state[2])

    through_zero.terminal, through_zero.direction = True, -1.0  # type: ignore[attr-defined]
    found = solve_ivp(
        wall.slopes,
        (start_s, start_s + _TURNING_S),
        state,
        method="LSODA",
        events=through_zero,
        rtol=1e-9,
        atol=[1e-11, 1e-12, 1e-11, 1e-9, 1e-9, 1e-9],
        max_step=_LONGEST_STEP_S,
    )
    return (found.t, found.y) if found.status == 1 else None


def _pieces(times_s: Floats, courses: Floats, end_s: float) -> Floats:
    """Cubics between instants a quarter of a millisecond apart or more, (m, 19), and rest from `end_s` on."""
    kept = np.flatnonzero(np.diff(np.floor(times_s / _SHORTEST_PIECE_S), prepend=-1.0) > 0.0)
    kept = np.unique(np.append(kept, times_s.size - 1))
    at, theta, omega = times_s[kept], courses[2, kept], courses[5, kept]
    long_s = np.diff(at)
    table = np.zeros((long_s.size, pc.N_COLUMNS))
    table[:, pc.START], table[:, pc.SCALE], table[:, pc.SIDE] = at[:-1], long_s, np.sign(theta[:-1])
    rise, low, high = np.diff(theta), omega[:-1] * long_s, omega[1:] * long_s
    for power, value in enumerate((theta[:-1], low, 3.0 * rise - 2.0 * low - high, low + high - 2.0 * rise)):
        table[:, pc.ROTATION + power] = value
        if power > 0:
            table[:, pc.VELOCITY + power - 1] = power * value / long_s
    return np.vstack((table, pc.constant_piece(end_s, 0.0)))

"""What happens at the wall from power-on: rotation, knocks, and what the wall is like, as tables."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sim_hardware.dynamics import Motion
from sim_hardware.dynamics import parameters as par
from sim_hardware.dynamics import pieces as pc
from sim_hardware.sensors import layout as la
from sim_hardware.sensors.state import march


@dataclass(frozen=True, slots=True)
class Knock:
    """A blow that rings in the accelerometers and does not move the wall."""

    time_s: float
    intensity_rad_s: float
    """As loud as an impact of that approach speed."""
    jump_rad_s: float = 0.0
    """Kick to the wall's oscillators, as from a velocity jump of this size."""


@dataclass(frozen=True, slots=True)
class Scene:
    """Immutable tables (sim_hardware.sensors.layout); times in seconds since power-on."""

    pieces: NDArray[np.float64]
    events: NDArray[np.float64]
    epochs: NDArray[np.float64]
    height_m: float

    @classmethod
    def upright(cls, vector: NDArray[np.float64], height_m: float) -> Scene:
        """The wall of a kernel vector, upright and untouched."""
        first = np.zeros((1, la.N_EVENT))
        first[0, la.EV_TIME] = -1e9
        pieces = pc.constant_piece(-1e9, 0.0)[None, :]
        return cls(pieces, first, epoch_row(vector, height_m, -1e9)[None, :], height_m)

    def cut(self, time_s: float) -> Scene:
        """All that happens before `time_s`."""
        return replace(
            self,
            pieces=self.pieces[self.pieces[:, pc.START] < time_s],
            events=self.events[self.events[:, la.EV_TIME] < time_s],
            epochs=self.epochs[self.epochs[:, la.EP_TIME] < time_s],
        )

    def with_path(self, pieces: NDArray[np.float64]) -> Scene:
        """Followed by these pieces, which start after the last one."""
        return replace(self, pieces=np.concatenate([self.pieces, pieces]))

    def with_knocks(self, knocks: list[Knock]) -> Scene:
        """With these knocks among the events."""
        rows = np.zeros((len(knocks), la.N_EVENT))
        for row, knock in zip(rows, knocks, strict=True):
            row[la.EV_TIME], row[la.EV_INTENSITY] = knock.time_s, knock.intensity_rad_s
            row[la.EV_JUMP] = knock.jump_rad_s
        return self._with_events(rows)

    def with_motion(self, motion: Motion, release_s: float) -> Scene:
        """Released at `release_s` (before: as it was), with the impacts of `motion`."""
        pieces = motion.pieces.copy()
        pieces[:, pc.START] += release_s
        epoch = epoch_row(motion.vector, self.height_m, release_s)
        rows = np.zeros((len(motion.impact_time_s), la.N_EVENT))
        rows[:, la.EV_TIME] = motion.impact_time_s + release_s
        rows[:, la.EV_BEFORE] = motion.velocity_before_rad_s
        rows[:, la.EV_AFTER] = motion.velocity_after_rad_s
        rows[:, la.EV_SIDE] = -np.sign(motion.velocity_before_rad_s)
        rows[:, la.EV_INTENSITY] = np.abs(motion.velocity_before_rad_s)
        rows[:, la.EV_JUMP] = motion.velocity_after_rad_s - motion.velocity_before_rad_s
        before = motion.velocity_before_rad_s
        for way, size, square in (
            (before, par.SLIDE, par.SLIDE_SQUARE),
            (np.abs(before), par.SLIDE_ON, par.SLIDE_ON_SQUARE),
        ):
            grown = 1.0 + motion.vector[square] * (np.abs(before) / par.SLIDE_SPEED - 1.0)
            rows[:, la.EV_SLIP] += motion.vector[size] * way * grown
        alternation = motion.vector[par.TURN_ALTERNATION]
        turning = math.cos(alternation) * np.abs(before) + math.sin(alternation) * before
        rows[:, la.EV_TURN] = motion.vector[par.TURN] * turning
        grown = replace(
            self,
            pieces=np.concatenate([self.pieces, pieces]),
            epochs=np.concatenate([self.epochs, epoch[None, :]]),
        )
        return grown._with_events(rows)

    def rotation_at(self, time_s: float) -> tuple[float, float, float]:
        """(θ, θ̇, θ̈) of the joint at one instant."""
        theta, omega, acceleration = np.empty(1), np.empty(1), np.empty(1)
        pc.evaluate(self.pieces, np.array([time_s]), theta, omega, acceleration)
        return float(theta[0]), float(omega[0]), float(acceleration[0])

    def _with_events(self, rows: NDArray[np.float64]) -> Scene:
        events = np.concatenate([self.events, rows])
        events = events[np.argsort(events[:, la.EV_TIME], kind="stable")]
        march(events, self.epochs)
        return replace(self, events=events)


def pivots(vector: NDArray[np.float64]) -> tuple[float, float]:
    """(right, left) distance of the pivots from the middle of the base, m, as the kernel has them."""
    height = vector[par.R0] * math.cos(vector[par.ALPHA])
    half = vector[par.R0] * math.sin(vector[par.ALPHA]) - vector[par.PIVOT_SHIFT]
    angle = math.atan(half / height) * (1.0 - vector[par.CRUSH_ALPHA] * 0.01 * vector[par.IMPACTS_BEFORE])
    right, left = (height * math.tan(angle + s * vector[par.ALPHA_ASYMMETRY]) for s in (1.0, -1.0))
    return right, left


def epoch_row(vector: NDArray[np.float64], height_m: float, start_s: float) -> NDArray[np.float64]:
    """What holds from `start_s`, where the vector has its ambient phase (power-on, or the release)."""
    row = np.zeros(la.N_EPOCH)
    row[la.EP_TIME], row[la.EP_HEIGHT] = start_s, height_m
    row[la.EP_RIGHT], row[la.EP_LEFT] = pivots(vector)
    for column, parameter in (
        (la.EP_EDGE, par.EDGE_RADIUS),
        (la.EP_WINKLER, par.WINKLER),
        (la.EP_COMPLIANCE, par.COMPLIANCE),
        (la.EP_ALPHA, par.ALPHA),
        (la.EP_MODE_ZETA, par.MODE_ZETA),
        (la.EP_MODE_GAIN, par.MODE_GAIN),
        (la.EP_TWIST_ZETA, par.TWIST_ZETA),
        (la.EP_TWIST_KICK, par.TWIST_KICK),
        (la.EP_TWIST_FOLLOW, par.TWIST_FOLLOW),
        (la.EP_YAW_KICK, par.YAW_KICK),
        (la.EP_AMBIENT, par.AMBIENT),
    ):
        row[column] = vector[parameter]
    row[la.EP_MODE_W] = 2.0 * math.pi * vector[par.MODE_HZ]
    row[la.EP_TWIST_W] = 2.0 * math.pi * vector[par.TWIST_HZ]
    row[la.EP_AMBIENT_W] = 2.0 * math.pi * vector[par.AMBIENT_HZ]
    row[la.EP_AMBIENT_PHASE] = vector[par.AMBIENT_PHASE] - row[la.EP_AMBIENT_W] * max(start_s, 0.0)
    return row

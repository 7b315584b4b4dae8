"""What the wall does in space, sample by sample: rotation, joint, slip, twist, bending, floor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from daq_app.gap.blind.world.arrays import FloatArray
from daq_app.gap.blind.world.events.joint import Parameters
from daq_app.gap.blind.world.events.mechanics import Effects, Mechanics, ground_acceleration
from daq_app.gap.blind.world.events.motion import Followed, ImpactRecord
from daq_app.gap.blind.world.shock import Shock

_SETTLE_S = 0.003
_TURN_S = 0.02
"""Time in which a wall slides into its new place about a corner."""
_SLIP_SPEED_RAD_S = 0.2
"""Speed at which slips in proportion to ω and to ω² are as large."""
_FADE = 7.0
"""A ring-down is followed for this many time constants (0.1 %)."""


@dataclass(frozen=True, slots=True)
class Scene:
    """All at the times `time_s` (n,), seconds after the release; SI units."""

    time_s: FloatArray
    theta: FloatArray
    """Rotation of the wall against its base."""
    omega: FloatArray
    theta_dd: FloatArray
    lean: FloatArray
    """Rotation against gravity and the fixed frame: θ plus what the base gives way."""
    pivot_x: FloatArray
    lift: FloatArray
    slip: FloatArray
    yaw: FloatArray
    yaw_dd: FloatArray
    bend: FloatArray
    """Displacement of the top by bending."""
    bend_dd: FloatArray
    ground: FloatArray
    impact_times: FloatArray
    impact_jumps: FloatArray
    """Change of ω at each impact."""
    height: float
    pivot_dd: tuple[FloatArray, FloatArray] | None = None
    """(x, z) acceleration of the turning point where impacts are resolved in time, so that `theta_dd` has
    their pulses; None where the turning point rests and an impact is a jump of ω."""
    shock: Shock = field(default_factory=Shock)

    @property
    def rate_hz(self) -> float:
        """Sampling rate of the times."""
        return 1.0 / float(self.time_s[1] - self.time_s[0])


def stage(mechanics: Mechanics, motion: Followed, effects: Effects, time_s: FloatArray) -> Scene:
    """Evaluate a run at rising times."""
    theta, omega, theta_dd = motion.sample(time_s)
    sign = np.sign(theta)
    side = np.where(sign == 0.0, 1.0, sign)
    pivot_x, lift = mechanics.joint.contact(np.abs(theta), side)
    worn = mechanics.wear_per_impact * mechanics.impacts_before
    times = np.array([i.time for i in motion.impacts])
    jumps = np.array([i.after - i.before for i in motion.impacts])
    zero = np.zeros_like(theta)
    yaw, yaw_dd = _ringing(effects.get("yaw"), time_s, times, jumps, mechanics.wall.length / 2.0)
    bend, bend_dd = _ringing(effects.get("flexible_wall"), time_s, times, jumps, mechanics.wall.height)
    # A wall that is free to turn recoils against its own bending.
    recoil = -effects.get("flexible_wall", {}).get("recoil", 0.0) / mechanics.wall.height
    ground = ground_acceleration(effects, motion.release)
    return Scene(
        time_s=time_s,
        theta=theta + recoil * bend,
        omega=omega,
        theta_dd=theta_dd + recoil * bend_dd,
        lean=theta + recoil * bend + _base_rotation(mechanics, theta, sign, time_s),
        pivot_x=np.broadcast_to(pivot_x * (1.0 - worn), theta.shape),
        lift=np.broadcast_to(lift, theta.shape),
        slip=_slip(mechanics, motion, time_s),
        yaw=yaw / (mechanics.wall.length / 2.0) + corner_twist(effects, time_s, motion.impacts),
        yaw_dd=yaw_dd / (mechanics.wall.length / 2.0),
        bend=bend,
        bend_dd=bend_dd,
        ground=zero if ground is None else ground(time_s),
        impact_times=times,
        impact_jumps=jumps,
        height=mechanics.wall.height,
    )


def _base_rotation(
    mechanics: Mechanics, theta: FloatArray, sign: FloatArray, time_s: FloatArray
) -> FloatArray:
    """Soft rig: the base turns in step with the moment of the reaction (within a few milliseconds)."""
    if mechanics.base_softness == 0.0:
        return np.zeros_like(theta)
    grid = np.concatenate([[0.0], np.geomspace(1e-6, 0.2, 200)])
    arms = np.array([mechanics.joint.arm(float(q), 1) for q in grid])
    demand = mechanics.base_softness * sign * np.interp(np.abs(theta), grid, arms)
    keep = math.exp(-(time_s[1] - time_s[0]) / _SETTLE_S)
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], demand, zi=[keep * demand[0]])[0])


def _slip(mechanics: Mechanics, motion: Followed, time_s: FloatArray) -> FloatArray:
    """Displacement of the base: a step at every impact, c·ω, of which a share goes with ω² instead."""
    slip = np.zeros_like(time_s)
    if mechanics.slip_s:
        for impact in motion.impacts:
            grown = 1.0 + mechanics.slip_square * (abs(impact.before) / _SLIP_SPEED_RAD_S - 1.0)
            slip[np.searchsorted(time_s, impact.time) :] += mechanics.slip_s * impact.before * grown
    return slip


def corner_twist(effects: Effects, time_s: FloatArray, impacts: Sequence[ImpactRecord]) -> FloatArray | float:
    """Rotation about the vertical, rad: impacts from the + side turn the wall a little about a corner."""
    if "corner_twist" not in effects:
        return 0.0
    per_speed = effects["corner_twist"]["turn_s"]
    turned = np.zeros_like(time_s)
    for impact in impacts:
        if impact.side > 0:
            turned -= per_speed * impact.before * -np.expm1(-np.maximum(time_s - impact.time, 0.0) / _TURN_S)
    return turned


def _ringing(
    effect: Parameters | None, time_s: FloatArray, times: FloatArray, jumps: FloatArray, length: float
) -> tuple[FloatArray, FloatArray]:
    """Displacement (m, at distance `length`) and acceleration of one damped mode kicked by each Δω."""
    value, acceleration = np.zeros_like(time_s), np.zeros_like(time_s)
    if effect is None:
        return value, acceleration
    natural = 2.0 * math.pi * effect["frequency_hz"]
    decay = effect["zeta"] * natural
    damped = natural * math.sqrt(1.0 - effect["zeta"] ** 2)
    for start, jump in zip(times, jumps, strict=True):
        low, high = np.searchsorted(time_s, [start, start + _FADE / decay])
        t = time_s[low:high] - start
        speed = effect["gain"] * length * jump
        fade = speed * np.exp(-decay * t)
        wave = fade * np.sin(damped * t) / damped
        value[low:high] += wave
        acceleration[low:high] += -(natural**2) * wave - 2.0 * decay * (
            fade * np.cos(damped * t) - decay * wave
        )
    return value, acceleration

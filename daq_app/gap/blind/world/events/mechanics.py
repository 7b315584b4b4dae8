"""Equation of motion and impact law of one run, put together from the wall and the effects of its case."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from daq_app.gap.blind.world.events.joint import JOINTS, Joint, Parameters, rigid
from daq_app.gap.blind.world.wall import GRAVITY_M_S2, Wall

Effects = Mapping[str, Parameters]
Term = Callable[[float, float, float, int], float]
"""(time after release, θ, ω, side) → angular acceleration, rad/s²."""
_FAR: Final = 50.0
"""Logarithm of a moment that no wall has."""
_FLOOR_LINES: Final = 60
"""Sinusoids of an irregular floor: over a test of ten seconds nobody tells so many from noise."""
ImpactTerm = Callable[["Impact"], float]
"""Change of the restitution at an impact."""


@dataclass(frozen=True, slots=True)
class Impact:
    """What the impact law may depend on."""

    total: int
    """Impacts of the specimen before this one, over all runs of the case."""
    speed: float
    """|ω| before it, rad/s."""
    side: int
    """Side from which the wall comes."""
    rest_s: float
    """Time since the impact before it."""


@dataclass(frozen=True, slots=True)
class Release:
    """How one run begins."""

    theta0: float
    omega0: float
    hold_s: float
    seed: int
    """Seed of the floor's phase and of the impact scatter in this run."""
    index: int = 0
    """Place in the campaign, from 0."""
    impacts_before: int = 0


@dataclass(slots=True)
class Mechanics:
    """`acceleration(t, θ, ω, s)` with t counted from the release, and `restitution(impact)`."""

    wall: Wall
    joint: Joint
    terms: list[Term] = field(default_factory=list)
    impact_terms: list[ImpactTerm] = field(default_factory=list)
    wear_per_impact: float = 0.0
    """Relative loss of the lever arm with every impact of the specimen."""
    side_arm: float = 0.0
    """Arm longer by this on the + side and shorter on the − side, m."""
    tilt: float = 0.0
    """Rotation of the base against gravity towards +x, rad."""
    base_softness: float = 0.0
    """Rotation of the base per unit of lever arm of the reaction, rad/m."""
    dwell_s: float = 0.0
    bounce_s: float = 0.0
    slip_s: float = 0.0
    """Slip of the base at an impact per unit of ω, m s/rad."""
    slip_square: float = 0.0
    """Share of it that goes with ω instead."""
    release_ramp_s: float = 0.0
    wear_in_run: tuple[float, int] = (0.0, -1)
    """(relative loss of arm, impact number from which it holds): a sudden crack."""
    impacts_before: int = 0
    impacts_done: int = 0
    """In this run so far; the integrator counts."""
    heading: int = 1
    """Sign of ω in the half-swing at hand: friction asks it, and not ω, which may be 0 at the ends."""

    def arm(self, theta: float, side: int) -> float:
        worn = 1.0 - self.wear_per_impact * (self.impacts_before + self.impacts_done)
        loss, start = self.wear_in_run
        if 0 <= start <= self.impacts_done:
            worn -= loss
        return self.joint.arm(side * theta, side) * worn + side * self.side_arm

    def acceleration(self, t: float, theta: float, omega: float, side: int) -> float:
        wall = self.wall
        arm = self.arm(theta, side)
        rise = self.joint.rise(side * theta)
        lean = theta + self.tilt + side * self.base_softness * arm
        # Weight about the contact: arm cos θ − (h − rise) sin|θ|, gravity seen from a base that leans.
        moment = -side * arm * math.cos(lean) + (wall.centroid_height - rise) * math.sin(lean)
        value = wall.mass_kg * GRAVITY_M_S2 * moment / wall.inertia_about(self.joint.inertia_arm)
        for term in self.terms:
            value += term(t, theta, omega, side)
        if t < self.release_ramp_s:
            value *= t / self.release_ramp_s
        return value

    def restitution(self, impact: Impact, scatter: float) -> float:
        r = self.wall.restitution
        for term in self.impact_terms:
            r += term(impact)
        return min(0.999, max(0.3, r * (1.0 + scatter)))


def build(wall: Wall, effects: Effects, release: Release) -> Mechanics:
    """The mechanics of one run. Effects that act on sensors or on the scene only are passed over."""
    joint = rigid(wall)
    for name, parameters in effects.items():
        if name in JOINTS:
            joint = JOINTS[name](wall, parameters)
    mechanics = Mechanics(wall, joint, impacts_before=release.impacts_before)
    for name, parameters in effects.items():
        if name in _ADD:
            _ADD[name](mechanics, parameters, release)
    return mechanics


def _viscous(m: Mechanics, q: Parameters, release: Release) -> None:
    factor = 2.0 * q["zeta"] * m.wall.p
    m.terms.append(lambda t, theta, omega, side: -factor * omega)


def _coulomb(m: Mechanics, q: Parameters, release: Release) -> None:
    level = q["mu"] * m.wall.p**2 * m.wall.alpha
    m.terms.append(lambda t, theta, omega, side: -level * m.heading)


def _quadratic_drag(m: Mechanics, q: Parameters, release: Release) -> None:
    factor = q["c"]
    m.terms.append(lambda t, theta, omega, side: -factor * omega * abs(omega))


def _one_sided_drag(m: Mechanics, q: Parameters, release: Release) -> None:
    """A loss that acts only while the wall falls towards its base on the − side (a rubbing cover)."""
    factor = q["rate_1_s"]
    m.terms.append(lambda t, theta, omega, side: -factor * omega if side < 0 < m.heading else 0.0)


def _hysteretic_joint(m: Mechanics, q: Parameters, release: Release) -> None:
    """Loading and unloading of the joint near upright follow two branches: a loop in M(θ)."""
    width = q["theta_h_rad"]
    level = q["share"] * m.wall.p**2 * m.wall.alpha

    def loop(t: float, theta: float, omega: float, side: int) -> float:
        # An implicit solver tries steps far beyond upright, where nothing is ever used.
        return -level * m.heading * math.exp(min(-side * theta / width, _FAR))

    m.terms.append(loop)


def _residual_cable(m: Mechanics, q: Parameters, release: Release) -> None:
    """A cable left on, taut beyond a share `slack` of θ0: a spring on the release side only."""
    stiffness = q["k"] * m.wall.p**2
    slack = q["slack"] * abs(release.theta0)
    on = 1 if release.theta0 > 0 else -1

    def pull(t: float, theta: float, omega: float, side: int) -> float:
        return -on * stiffness * max(0.0, on * theta - slack)

    m.terms.append(pull)


def _taut_cable(m: Mechanics, q: Parameters, release: Release) -> None:
    """A cable under tension at upright, on one side of the rig or on the side of each release."""
    towards = math.copysign(1.0, q["side"])
    if q["moved"] > 0.5:
        towards *= math.copysign(1.0, release.theta0)
    stiffness, reach = q["k"] * m.wall.p**2, q["reach_rad"]
    m.terms.append(lambda t, theta, omega, side: towards * stiffness * max(0.0, reach - towards * theta))


def _rope_snag(m: Mechanics, q: Parameters, release: Release) -> None:
    """Outside: a rope catches once, for a tenth of a second."""
    start, length, strength = q["at_s"], 0.1, q["strength"] * m.wall.p**2 * m.wall.alpha

    def snag(t: float, theta: float, omega: float, side: int) -> float:
        x = (t - start) / length
        return -m.heading * strength * math.sin(math.pi * x) ** 2 if 0.0 < x < 1.0 else 0.0

    m.terms.append(snag)


def ground_acceleration(effects: Effects, release: Release) -> Callable[[np.ndarray], np.ndarray] | None:
    """Horizontal acceleration of the floor (m/s²) against time after release, or None."""
    rng = np.random.default_rng(release.seed)
    phase = rng.uniform(0.0, 2.0 * math.pi)
    start = rng.uniform(0.3, 2.5)
    if "ambient" in effects:
        q = effects["ambient"]
        return lambda t: q["amplitude_m_s2"] * np.sin(2.0 * math.pi * q["frequency_hz"] * t + phase)
    if "passing_lorry" in effects:
        q = effects["passing_lorry"]

        def lorry(t: np.ndarray) -> np.ndarray:
            swell = np.exp(-(((t - start) / 0.5) ** 2))
            return q["amplitude_m_s2"] * swell * np.sin(2.0 * math.pi * q["frequency_hz"] * t + phase)

        return lorry
    if "irregular_floor" in effects:
        return _irregular(effects["irregular_floor"], rng)
    return None


def _irregular(q: Parameters, rng: np.random.Generator) -> Callable[[np.ndarray], np.ndarray]:
    """Traffic: sinusoids of every frequency of a band, each with a phase of its own."""
    frequencies = rng.uniform(q["low_hz"], q["low_hz"] + q["band_hz"], _FLOOR_LINES)
    phases = rng.uniform(0.0, 2.0 * math.pi, _FLOOR_LINES)
    size = q["rms_m_s2"] * math.sqrt(2.0 / _FLOOR_LINES)

    def floor(t: np.ndarray) -> np.ndarray:
        angles = 2.0 * math.pi * np.multiply.outer(t, frequencies) + phases
        return np.asarray(size * np.sin(angles).sum(axis=-1))

    return floor


def _shaken(m: Mechanics, effects: Effects, release: Release) -> None:
    ground = ground_acceleration(effects, release)
    assert ground is not None
    factor = m.wall.p**2 / GRAVITY_M_S2
    alpha = m.wall.alpha
    m.terms.append(
        lambda t, theta, omega, side: -factor * math.cos(alpha * side - theta) * float(ground(np.float64(t)))  # type: ignore[arg-type]
    )


def _set(name: str, key: str) -> Callable[[Mechanics, Parameters, Release], None]:
    def add(m: Mechanics, q: Parameters, release: Release) -> None:
        setattr(m, name, q[key])

    return add


def _sliding(m: Mechanics, q: Parameters, release: Release) -> None:
    m.slip_s, m.slip_square = q["c_m_s"], q["square"]


def _stepped(q: Parameters) -> ImpactTerm:
    return lambda i: q["step"] * (0.5 if i.speed > q["speed_rad_s"] else -0.5)


def _impact(make: Callable[[Parameters], ImpactTerm]) -> Callable[[Mechanics, Parameters, Release], None]:
    return lambda m, q, release: m.impact_terms.append(make(q))


def _crushing(m: Mechanics, q: Parameters, release: Release) -> None:
    m.wear_per_impact = q["loss_per_100"] / 100.0


def _alpha_asymmetry(m: Mechanics, q: Parameters, release: Release) -> None:
    m.side_arm = m.wall.centroid_height * math.tan(m.wall.alpha + q["delta_rad"]) - m.wall.half_width


def _eccentric(m: Mechanics, q: Parameters, release: Release) -> None:
    m.side_arm = -q["e_m"]


def _compliance(m: Mechanics, q: Parameters, release: Release) -> None:
    m.base_softness = q["phi_rad"] / m.wall.half_width


def _sudden_crack(m: Mechanics, q: Parameters, release: Release) -> None:
    """Outside: a stone breaks at the seventh impact of the second run, and stays broken."""
    if release.index >= 1:
        m.wear_in_run = (q["loss"], 6 if release.index == 1 else 0)


_ADD: dict[str, Callable[[Mechanics, Parameters, Release], None]] = {
    "viscous": _viscous,
    "coulomb": _coulomb,
    "quadratic_drag": _quadratic_drag,
    "one_sided_drag": _one_sided_drag,
    "hysteretic_joint": _hysteretic_joint,
    "residual_cable": _residual_cable,
    "taut_cable": _taut_cable,
    "rope_snag": _rope_snag,
    "ambient": lambda m, q, release: _shaken(m, {"ambient": q}, release),
    "passing_lorry": lambda m, q, release: _shaken(m, {"passing_lorry": q}, release),
    "irregular_floor": lambda m, q, release: _shaken(m, {"irregular_floor": q}, release),
    "crushing": _crushing,
    "alpha_asymmetry": _alpha_asymmetry,
    "base_tilt": _set("tilt", "beta_rad"),
    "eccentric_mass": _eccentric,
    "compliance": _compliance,
    "dwell": _set("dwell_s", "tau_s"),
    "bounce": _set("bounce_s", "tau_s"),
    "sliding": _sliding,
    "slow_release": _set("release_ramp_s", "tau_s"),
    "sudden_crack": _sudden_crack,
    "restitution_slope": _impact(lambda q: lambda i: q["k_s_rad"] * (i.speed - 0.25)),
    "restitution_asymmetry": _impact(lambda q: lambda i: q["d"] * i.side),
    "restitution_wear": _impact(lambda q: lambda i: -q["loss_per_100"] * i.total / 100.0),
    "stepped_restitution": _impact(_stepped),
    "restitution_memory": _impact(lambda q: lambda i: -q["drop"] * math.exp(-i.rest_s / 0.15)),
}

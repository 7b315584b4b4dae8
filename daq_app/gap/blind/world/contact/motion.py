"""One run by a contact engine (MuJoCo, optional extra ``contact``): the wall is a rigid body on a floor.

Nothing is told of rocking: a body with a mass, an inertia and feet is pulled to θ0, held and let go in its
plane, and the engine finds every contact force by itself. That is a second set of numerics that shares
neither the equations of `mechanics` nor those of any diagnosis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Final

import numpy as np

from daq_app.gap.blind.world.arrays import FloatArray
from daq_app.gap.blind.world.contact.feet import Foot, feet, plastic_restitution
from daq_app.gap.blind.world.events.mechanics import Effects, Release
from daq_app.gap.blind.world.events.motion import LONGEST_S, REST_RAD, Followed, ImpactRecord
from daq_app.gap.blind.world.events.scene import Scene, corner_twist
from daq_app.gap.blind.world.laboratories.numerics import Numerics
from daq_app.gap.blind.world.wall import GRAVITY_M_S2, Wall

_AS_OWN: Final = Numerics()
_STONE: Final = 'solimp="0.99 0.999 0.0001 0.5 2"'
"""Stone on stone, critically damped: settled after four time constants of its contact."""
_SETTLED: Final = 8.0
"""Time constants of a contact after which an impact is over."""
_SOFT_SHARE: Final = 0.02
"""Impedance of a spring: so low that the engine adds next to no inertia of its own to it."""
_SETTLE_S, _PULL_S, _HOLD_S = 0.3, 0.6, 0.4
_IMPACT_S: Final = 0.004
"""From upright until an impact is over, at least."""
_LONGEST_HALF_CYCLE_S: Final = 4.0
_CHUNK: Final = 1000


class EngineMissing(Exception):
    """The contact engine is not installed."""


@dataclass(frozen=True, slots=True)
class ContactMotion(Followed):
    """The motion of one run, from states at every step."""

    time_s: FloatArray
    """(n,) from 0."""
    states: FloatArray
    """(9, n): x, z of the middle of the base, θ; their velocities; their accelerations."""
    upright: FloatArray
    """(3,) x, z, θ of the wall that stands, before it is pulled."""

    def sample(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        theta = np.interp(time_s, self.time_s, self.states[2]) - self.upright[2]
        return theta, self._moving(time_s, 5), self._moving(time_s, 8)

    def base(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """x, z of the middle of the base from where it stood upright, and their accelerations."""
        x = np.interp(time_s, self.time_s, self.states[0]) - self.upright[0]
        z = np.interp(time_s, self.time_s, self.states[1]) - self.upright[1]
        return x, z, self._moving(time_s, 6), self._moving(time_s, 7)

    def _moving(self, time_s: FloatArray, row: int) -> FloatArray:
        return np.asarray(np.interp(time_s, self.time_s, self.states[row], left=0.0, right=0.0))


def rock(wall: Wall, effects: Effects, release: Release, numerics: Numerics = _AS_OWN) -> ContactMotion:
    """Pull, hold and let go, and follow the wall to rest (at most 40 s).

    What contact itself takes at an impact is Housner's for sharp edges. A wall's own r and its scatter come
    on top, as the unevenness of real stones does: all speeds are scaled by what is left.

    Raises `EngineMissing` where MuJoCo is not installed.
    """
    engine = require_engine()
    model = _model(engine, wall, effects, numerics)
    crushing = _Crushing(model, wall, effects, release)
    data = engine.MjData(model)
    upright = _pull(engine, model, data, release, numerics.step_s)
    arm = math.copysign(wall.half_width, release.theta0)
    turn = release.theta0
    data.qvel[:] = release.omega0 * np.array([arm * math.sin(turn), arm * math.cos(turn), 1.0])
    watch = _Watch(wall, release, max(_IMPACT_S, _SETTLED * numerics.settle_s))
    blocks: list[FloatArray] = []
    while not watch.ended and len(blocks) * _CHUNK * numerics.step_s < LONGEST_S:
        block = np.empty((_CHUNK, 9))
        for row in block:
            if watch.look(data):
                crushing.impact()
            row[:3], row[3:6] = data.qpos, data.qvel
            engine.mj_step(model, data)
            row[6:] = data.qacc
        blocks.append(block)
    states = np.concatenate(blocks).T
    time_s = numerics.step_s * np.arange(states.shape[1], dtype=np.float64)
    rest_s = watch.time_s if watch.ended else float(time_s[-1])
    return ContactMotion(release, tuple(watch.impacts), tuple(watch.peaks), rest_s, time_s, states, upright)


def contact_stage(motion: ContactMotion, wall: Wall, effects: Effects, time_s: FloatArray) -> Scene:
    """Evaluate a run at rising times: the wall turns about the middle of its base, and that moves."""
    theta, omega, theta_dd = motion.sample(time_s)
    x, z, x_dd, z_dd = motion.base(time_s)
    zero = np.zeros_like(theta)
    return Scene(
        time_s=time_s,
        theta=theta,
        omega=omega,
        theta_dd=theta_dd,
        lean=theta,
        pivot_x=zero,
        lift=z,
        slip=x,
        yaw=zero + corner_twist(effects, time_s, motion.impacts),
        yaw_dd=zero,
        bend=zero,
        bend_dd=zero,
        ground=zero,
        impact_times=np.array([impact.time for impact in motion.impacts]),
        impact_jumps=np.array([impact.after - impact.before for impact in motion.impacts]),
        height=wall.height,
        pivot_dd=(x_dd, z_dd),
    )


class _Watch:
    """Looks at the engine's state before every step: turning points, impacts, rest.

    What an impact takes beyond a plastic one, it takes as the wall comes down: scaled after the contact has
    done its part, the wall would have gone on for that long at another speed.
    """

    def __init__(self, wall: Wall, release: Release, impact_s: float) -> None:
        self._impact_s = impact_s
        self._share = wall.restitution / plastic_restitution(wall)
        self._slows = wall.p**2 * math.sin(wall.alpha)
        self._scatter_sd = wall.restitution_scatter
        self._scatter = np.random.default_rng([release.seed, 1])
        self._side = 1 if release.theta0 > 0 else -1
        self._peak = (0.0, release.theta0)
        self._struck: tuple[float, float] | None = None
        self._last = (0.0, release.theta0)
        self.impacts: list[ImpactRecord] = []
        self.peaks: list[tuple[float, float]] = []
        self.time_s = 0.0
        self.ended = False

    def look(self, data: Any) -> bool:
        """Note what happened; at an impact (True), let it take what this one takes of its own."""
        before, self._last = self._last, (float(data.time), float(data.qpos[2]))
        if self.ended:
            return False
        struck = False
        self.time_s, theta = self._last
        if self._struck is not None:
            if self.time_s >= self._struck[0] + self._impact_s:
                self._leave(data)
        elif theta * self._side < 0.0:
            share = before[1] / (before[1] - theta)
            self._strike(before[0] + share * (self.time_s - before[0]), float(data.qvel[2]))
            data.qvel[:] *= self._share * (1.0 + self._scatter_sd * self._scatter.standard_normal())
            struck = True
        if abs(theta) > abs(self._peak[1]) and theta * self._side > 0.0:
            self._peak = self._last
        since = self.impacts[-1].time if self.impacts else 0.0
        self.ended = self.ended or self.time_s - since > _LONGEST_HALF_CYCLE_S
        return struck

    def _strike(self, time: float, omega: float) -> None:
        if self._peak[0] > self._impact_s:  # else it was let go there
            self.peaks.append(self._peak)
        self.ended = abs(self._peak[1]) < REST_RAD
        self._struck, self._peak = (time, omega), (time, 0.0)
        self._side = -self._side

    def _leave(self, data: Any) -> None:
        assert self._struck is not None
        time, before = self._struck
        # As the impact left it: the weight has slowed it since (to half a per cent: for the first millisecond
        # the edge that lifts still bears some of it).
        after = float(data.qvel[2]) + self._side * self._slows * (self.time_s - time)
        self.impacts.append(ImpactRecord(time, before, after, -self._side, after / before))
        self._struck = None


class _Crushing:
    """Both edges are worn inwards by every impact of the specimen."""

    def __init__(self, model: Any, wall: Wall, effects: Effects, release: Release) -> None:
        self._places = model.geom_pos[1:, 0]
        self._arms = np.array(self._places)
        self._loss = effects.get("crushing", {}).get("loss_per_100", 0.0) / 100.0
        self._impacts = release.impacts_before
        self._wear()

    def impact(self) -> None:
        """One more: a tenth of a millimetre at most, on edges that both touch the floor then."""
        self._impacts += 1
        self._wear()

    def _wear(self) -> None:
        self._places[:] = self._arms * (1.0 - self._loss * self._impacts)


def _pull(engine: ModuleType, model: Any, data: Any, release: Release, step_s: float) -> FloatArray:
    """Stand, be pulled to θ0 by a moment, be held, be let go; returns x, z, θ of the wall that stood."""
    upright = np.zeros(3)
    steps = round((_SETTLE_S + _PULL_S + _HOLD_S) / step_s)
    for k in range(steps):
        share = min(max((k * step_s - _SETTLE_S) / _PULL_S, 0.0), 1.0)
        if share == 0.0:
            upright = np.array(data.qpos)
        model.eq_data[0, 0] = release.theta0 * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        engine.mj_step(model, data)
    data.eq_active[0] = 0
    data.time = 0.0
    return upright


def _model(engine: ModuleType, wall: Wall, effects: Effects, numerics: Numerics) -> Any:
    """The wall as MuJoCo wants it: three joints in its plane, feet, and a hold on its rotation."""
    model = engine.MjModel.from_xml_string(_text(wall, effects, numerics, 1.0))
    # The engine counts stiffness against what it takes for the mobility of the body.
    return engine.MjModel.from_xml_string(_text(wall, effects, numerics, float(model.body_invweight0[1, 0])))


def _text(wall: Wall, effects: Effects, numerics: Numerics, mobility: float) -> str:
    tilt = effects.get("base_tilt", {}).get("beta_rad", 0.0)
    along, down = GRAVITY_M_S2 * math.sin(tilt), GRAVITY_M_S2 * math.cos(tilt)
    off = effects.get("eccentric_mass", {}).get("e_m", 0.0)
    standing = feet(wall, effects)
    # The edges of a pyramid share a spring's force by another rule, which makes it a thousand times stiffer.
    cone = "elliptic" if any(foot.spring for foot in standing) else numerics.cone
    inertia = " ".join(3 * [f"{wall.inertia_cg:.17g}"])
    return f"""<mujoco>
<option timestep="{numerics.step_s:.9g}" gravity="{along:.17g} 0 {-down:.17g}"
  cone="{cone}" solver="{numerics.constraint_solver}"
  integrator="implicitfast" impratio="1000" iterations="200" tolerance="1e-14"/>
<worldbody><geom type="plane" size="10 10 1"/>
<body><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
<joint name="turn" type="hinge" axis="0 1 0"/>
<inertial pos="{off:.17g} 0 {wall.centroid_height:.17g}" mass="{wall.mass_kg:.17g}" diaginertia="{inertia}"/>
{"".join(_geom(foot, numerics.settle_s, mobility) for foot in standing)}</body></worldbody>
<equality><joint joint1="turn" polycoef="0 0 0 0 0" solref="0.001 1" solimp="0.999 0.9999 0.0001"/></equality>
</mujoco>"""


def _geom(foot: Foot, settle_s: float, mobility: float) -> str:
    contact = f'solref="{settle_s:.9g} 1" {_STONE}'
    if foot.spring is not None:
        # Force = (stiffness r + damping v) / ((1 − d) × mobility) at an impedance of d.
        stiffness, damping = ((1.0 - _SOFT_SHARE) * mobility * value for value in foot.spring)
        contact = (
            f'solref="{-stiffness:.17g} {-damping:.17g}" solimp="{_SOFT_SHARE} {_SOFT_SHARE} 0.001 0.5 2"'
        )
    return (
        f'<geom type="sphere" size="{foot.radius_m:.17g}" pos="{foot.x_m:.17g} 0 '
        f'{foot.height_m + foot.radius_m:.17g}" priority="1" condim="3" '
        f'friction="{foot.friction:.17g} 0 0" {contact}/>'
    )


def require_engine() -> ModuleType:
    """The engine, which nothing else imports. Raises `EngineMissing`."""
    try:
        import mujoco
    except ImportError:
        raise EngineMissing(
            "the contact engine MuJoCo is not installed. Install the extra `contact`"
        ) from None
    engine: ModuleType = mujoco
    return engine

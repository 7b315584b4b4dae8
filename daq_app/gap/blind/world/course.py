"""How a run of a case comes about: by event integration or by a contact engine, one interface for both."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from daq_app.gap.blind.world.arrays import FloatArray
from daq_app.gap.blind.world.contact.motion import contact_stage, rock
from daq_app.gap.blind.world.events.mechanics import Effects, Release, build
from daq_app.gap.blind.world.events.motion import Followed, integrate
from daq_app.gap.blind.world.events.scene import Scene, stage
from daq_app.gap.blind.world.laboratories.numerics import Engine, Numerics
from daq_app.gap.blind.world.sway import Sway, swaying
from daq_app.gap.blind.world.wall import Wall


@dataclass(frozen=True, slots=True)
class Course:
    """One run: the motion, and what the sensors see of it."""

    motion: Followed
    scene: Callable[[FloatArray], Scene]
    """At rising times (n,), s after the release."""
    plain: Callable[[FloatArray], Scene]
    """The same motion of a rigid block on sharp edges with nothing hidden."""


def follow(
    engine: Engine, wall: Wall, effects: Effects, release: Release, numerics: Numerics, sway: Sway | None
) -> Course:
    """Let one run happen. Raises `EngineMissing` where the contact engine is not installed."""
    if sway is None:
        return _FOLLOW[engine](wall, effects, release, numerics)
    now = np.zeros(1)
    release = replace(
        release,
        theta0=release.theta0 + float(sway.at(now)[0]),
        omega0=release.omega0 + float(sway.at(now, 1)[0]),
    )
    course = _FOLLOW[engine](wall, effects, release, numerics)
    return Course(
        course.motion,
        lambda time_s: swaying(course.scene(time_s), sway, wall),
        lambda time_s: swaying(course.plain(time_s), sway, wall),
    )


def _by_events(wall: Wall, effects: Effects, release: Release, numerics: Numerics) -> Course:
    mechanics = build(wall, effects, release)
    motion = integrate(mechanics, release, numerics)
    return Course(
        motion,
        lambda time_s: stage(mechanics, motion, effects, time_s),
        lambda time_s: stage(build(wall, {}, release), motion, {}, time_s),
    )


def _by_contact(wall: Wall, effects: Effects, release: Release, numerics: Numerics) -> Course:
    motion = rock(wall, effects, release, numerics)
    return Course(
        motion,
        lambda time_s: contact_stage(motion, wall, effects, time_s),
        lambda time_s: stage(build(wall, {}, release), motion, {}, time_s),
    )


_FOLLOW: Final[dict[Engine, Callable[[Wall, Effects, Release, Numerics], Course]]] = {
    "events": _by_events,
    "contact": _by_contact,
}

"""A held wall sways on its cable: the rotation before the release, and the speed that it is let go with."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from daq_app.gap.blind.world.arrays import FloatArray
from daq_app.gap.blind.world.events.scene import Scene
from daq_app.gap.blind.world.wall import Wall


@dataclass(frozen=True, slots=True)
class Sway:
    """Sum of harmonics, about the rotation at which the wall is held."""

    amplitudes_rad: tuple[float, ...]
    angular_hz: tuple[float, ...]
    """2π × frequency of each."""
    phases: tuple[float, ...]

    def at(self, time_s: FloatArray, derivative: int = 0) -> FloatArray:
        """Rotation (n,) at times after the release, or a derivative of it in time."""
        value = np.zeros_like(time_s)
        for amplitude, rate, phase in zip(self.amplitudes_rad, self.angular_hz, self.phases, strict=True):
            value += amplitude * rate**derivative * np.sin(rate * time_s + phase + derivative * math.pi / 2)
        return value


def draw_sway(amplitude_rad: float, rng: np.random.Generator) -> Sway:
    """Two harmonics of 0.4 to 3 Hz, the second half as large."""
    rates = 2.0 * math.pi * rng.uniform(0.4, 3.0, 2)
    phases = rng.uniform(0.0, 2.0 * math.pi, 2)
    return Sway((amplitude_rad, 0.5 * amplitude_rad), tuple(map(float, rates)), tuple(map(float, phases)))


def swaying(scene: Scene, sway: Sway, wall: Wall) -> Scene:
    """A scene whose held part sways into the state that the wall was let go with."""
    held = scene.time_s < 0.0
    time_s = scene.time_s[held]
    rotation, speed, acceleration = (np.zeros_like(scene.theta) for _ in range(3))
    rotation[held] = sway.at(time_s) - sway.at(np.zeros(1))
    speed[held] = sway.at(time_s, 1)
    acceleration[held] = sway.at(time_s, 2)
    # A contact engine's wall turns about the middle of its base, which rises with the rotation.
    rise = wall.half_width * np.sign(scene.theta) * rotation if scene.pivot_dd is not None else 0.0
    return replace(
        scene,
        theta=scene.theta + rotation,
        lean=scene.lean + rotation,
        omega=scene.omega + speed,
        theta_dd=scene.theta_dd + acceleration,
        lift=scene.lift + rise,
    )

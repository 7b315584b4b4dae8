"""Simulated tests of laboratories that differ: calibration, noise, hum, zero, clock, body and places drawn.

The analysis is given the nominal rig; the wall and its sensors are those of another rig, drawn about it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from daq_app.config import Rig, Scaling, plan_tasks
from daq_app.config.rig import Channel
from daq_app.rocking import TestRecord
from sim_hardware.direct import synthesise_test
from sim_hardware.dynamics.motion import simulate_vector
from sim_hardware.simulated_test import Engine

Floats = NDArray[np.float64]

_NO_EFFECTS: Final[Mapping[str, Mapping[str, float]]] = {}
_BODY_SHARE = 0.01
"""Relative standard deviation of α, R and I of the wall about the survey's."""
_POSITION_SIGMA_M = 0.001
"""Standard deviation of each coordinate of a sensor about the drawing."""
_DATUM_SIGMA_M = 0.001
"""Standard deviation of the level that the heights of all wires are measured from, about the wall's base."""
_FACES_SIGMA_M = 0.002
"""Standard deviation of the distance of the faces that LVDTs stand on about the survey's."""
_TIME_BASE_SIGMA_S = 2e-5
"""Standard deviation of each family's time base about what the analysis is told of it."""
_SLOW_SAMPLES = 20
"""Time constant of the slow part of the noise, samples."""


@dataclass(frozen=True)
class LaboratoryTest:
    """One test: SI values (channels, n) in rig order, as the analysis gets them, and the truth."""

    rig: Rig
    rate_hz: float
    si: Floats
    offsets_s: dict[str, float]
    truth: dict[str, Any]
    """`SynthesisedTest.truth`, times since power-on."""

    def record(self, label: str = "study") -> TestRecord:
        """The recording without a tare, as an imported run has it."""
        return TestRecord.from_array(
            self.rig, self.rate_hz, self.si, time_offsets_s=self.offsets_s, tared=False, label=label
        )

    def until_impact(self, n: int) -> LaboratoryTest:
        """The test whose recording ends half-way between impact `n` (1 is the first) and the next."""
        last_s, next_s = self.truth["impact_time_s"][n - 1 : n + 1]
        return replace(self, si=self.si[:, : round(0.5 * (last_s + next_s) * self.rate_hz)])

    def rows(self, family: str) -> list[int]:
        """Rows of the channels of a family that measure the rocking."""
        return [
            row
            for row, channel in enumerate(self.rig.channels)
            if channel.family == family and not (family == "tiltmeter" and channel.axis == "y")
        ]


def draw_test(
    nominal: Rig,
    seed: int,
    *,
    ordinary: bool = True,
    effects: Mapping[str, Mapping[str, float]] = _NO_EFFECTS,
    laboratory: int | None = None,
    level: float | None = None,
    engine: Engine = simulate_vector,
) -> LaboratoryTest:
    """A test of a laboratory drawn by `seed`; without `ordinary` its sensors are perfect but for noise.

    `effects`: what its wall does that Housner's block does not, by name with parameters. `laboratory`: the
    seed of all that one laboratory and its wall keep from test to test (calibration, places, levels of noise,
    clock, body, r and its scatter from impact to impact), so that several `seed` make a campaign. `level`:
    θ0 over α in place of the drawn one, to the drawn side. `engine`: what moves the wall once it is let go.
    """
    rng = np.random.default_rng(seed)
    kept = rng if laboratory is None else np.random.default_rng([laboratory, 3])
    of_all = np.random.default_rng([seed if laboratory is None else laboratory, 2])
    of_faces = np.random.default_rng([seed if laboratory is None else laboratory, 4])
    if ordinary:
        rig = _drawn_rig(nominal, kept, _DATUM_SIGMA_M * of_all.standard_normal())
        rig = _on_faces(rig, _FACES_SIGMA_M * of_faces.standard_normal())
    else:
        rig = nominal
    timing = {"upright_s": 1.0, "pull_s": 1.0, "hold_s": float(rng.uniform(4.0, 6.0))}
    scatter = float(kept.uniform(0.001, 0.006)) if ordinary else 0.0
    rig = rig.model_copy(
        update={"simulation": rig.simulation.model_copy(update=timing | {"restitution_scatter": scatter})}
    )
    plan = plan_tasks(rig)
    drawn, side = float(rng.uniform(0.15, 0.4)), float(rng.choice([-1.0, 1.0]))
    r = float(kept.uniform(0.82, 0.94))
    test = synthesise_test(
        rig,
        plan,
        side * (drawn if level is None else level),
        seed,
        restitution=r,
        effects=effects,
        engine=engine,
    )
    upright = test.readings[:, : test.upright_samples].mean(axis=1)
    zeros = {c.id: float(mean - c.offset) for c, mean in zip(rig.channels, upright, strict=True)}
    si = Scaling.of(rig.channels, zeros).to_si(test.readings)
    if ordinary:
        _spoil(si, rig, test.rate_hz, rng, kept)
    families = dict.fromkeys(channel.family for channel in rig.channels)
    off_s = {name: _TIME_BASE_SIGMA_S * of_all.standard_normal() if ordinary else 0.0 for name in families}
    planned = [channel for task in plan.tasks for channel in task.channels]
    offsets = {c.channel.id: c.time_offset_s + off_s[c.channel.family] for c in planned}
    return LaboratoryTest(nominal, test.rate_hz, si, offsets, test.truth)


def _drawn_rig(rig: Rig, rng: np.random.Generator, datum_m: float) -> Rig:
    """`datum_m`: by how much all wires are higher than in the drawing."""
    specimen = rig.specimen
    share = 1.0 + _BODY_SHARE * rng.standard_normal(3)
    body = specimen.model_copy(
        update={
            "alpha0_rad": specimen.alpha0_rad * share[0],
            "r0_m": specimen.r0_m * share[1],
            "rotational_inertia_kg_m2": specimen.rotational_inertia_kg_m2 * share[2] * share[1] ** 2,
        }
    )
    # In the rig's order: a set's is another one in every process, and a seed would name several tests.
    families = dict.fromkeys(channel.family for channel in rig.channels)
    noise = {family: 2.0 ** rng.uniform(-1.0, 1.0) for family in families}
    channels = tuple(
        _drawn_channel(channel, noise[channel.family], datum_m if channel.family == "wire" else 0.0, rng)
        for channel in rig.channels
    )
    return rig.model_copy(update={"specimen": body, "channels": channels})


def _on_faces(rig: Rig, further_m: float) -> Rig:
    """The rig with its LVDTs on faces that are further apart."""
    channels = []
    for channel in rig.channels:
        if channel.family == "lvdt":
            x, y, z = channel.position_m
            place = (x + math.copysign(0.5, x) * further_m, y, z)
            channel = channel.model_copy(update={"position_m": place})
        channels.append(channel)
    return rig.model_copy(update={"channels": tuple(channels)})


def _drawn_channel(channel: Channel, noise: float, higher_m: float, rng: np.random.Generator) -> Channel:
    def moved(place: tuple[float, float, float]) -> tuple[float, ...]:
        by = rng.normal(0.0, _POSITION_SIGMA_M, 3) + np.array([0.0, 0.0, higher_m])
        return tuple((np.asarray(place) + by).tolist())

    changes: dict[str, Any] = {"noise_si": channel.noise_si * noise, "position_m": moved(channel.position_m)}
    if channel.anchor_m is not None:
        changes["anchor_m"] = moved(channel.anchor_m)
    return channel.model_copy(update=changes)


def _spoil(si: Floats, rig: Rig, rate_hz: float, rng: np.random.Generator, kept: np.random.Generator) -> None:
    """Calibration, slow noise, weak hum and a walking zero, in place; `kept` draws the calibration."""
    n = si.shape[1]
    time = np.arange(n) / rate_hz
    calibration = float(kept.uniform(0.001, 0.003))
    mains_hz = 50.0 + float(rng.normal(0.0, 0.03))
    keep = math.exp(-1.0 / _SLOW_SAMPLES)
    for row, channel in enumerate(rig.channels):
        noise = channel.noise_si
        si[row] *= 1.0 + kept.normal(0.0, calibration)
        slow = lfilter([math.sqrt(1.0 - keep**2)], [1.0, -keep], rng.standard_normal(n))
        si[row] += 0.3 * noise * slow
        hum = noise * float(rng.uniform(0.05, 0.5))
        si[row] += hum * np.sin(2.0 * np.pi * (mains_hz * time + rng.uniform()))
        walk = np.cumsum(rng.standard_normal(n)) / math.sqrt(n)
        si[row] += 0.15 * noise * walk + rng.normal(0.0, 0.1 * noise)

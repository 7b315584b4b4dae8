"""How the sensors of one case stand and are wired: the rig file, off by what the laboratory is off."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from daq_app.config import Rig
from daq_app.config.rig import Channel
from daq_app.gap.blind.world.arrays import FloatArray
from daq_app.gap.blind.world.sensors.chain import finest_steps
from daq_app.gap.blind.world.sensors.faults import Fault

Sizes = Mapping[str, float]
"""Imperfection → its size in this case."""

_CABLES_THAT_MOVE: Final = 0.4
"""Share of the cables that touch something which moves."""
KICK_RAD_S: Final = 0.1
"""Jump of ω for which the size of a shaken cable is given."""
SPIKY: Final = 0.1
"""Share of the channels that spikes reach."""
_FAMILY_SHARE: Final = 0.8
"""Part of the logarithm of unequal noise that a family has in common."""


@dataclass(frozen=True, slots=True)
class Installation:
    """The same in all runs of a case; arrays have one element for each channel (n,)."""

    rig: Rig
    """As it stands: true anchors and time constants."""
    faults: tuple[Fault, ...]
    """Ordinary ones: turned mounts, play, sag, crosstalk."""
    noise_si: FloatArray
    skew_s: FloatArray
    """Sample time after the planned one."""
    step_v: FloatArray
    """Smallest step of a reading, in its unit."""
    mains_amplitude: FloatArray
    """Amplitude of the fundamental, in noises."""
    mains_phase: FloatArray
    """Radians against channel 0; of the fundamental."""
    cable: FloatArray
    """How much a channel's cable moves with impacts: 0 for most."""


def draw_installation(rig: Rig, sizes: Sizes, rng: np.random.Generator) -> Installation:
    """The installation of a case. What `sizes` does not name is as the rig file says."""
    channels = rig.channels
    n = len(channels)
    modules = [c.physical_channel.partition("/")[0] for c in channels]
    skew = sizes.get("skew", 0.0)
    lost_bits = sizes.get("coarse_steps", 0.0)
    mains = sizes.get("mains_pick_up", 0.0) * np.exp(rng.uniform(-0.7, 0.7, n))
    installation = Installation(
        rig=rig.model_copy(update={"channels": tuple(_as_it_stands(c, sizes, rng) for c in channels)}),
        faults=tuple(_ordinary_faults(rig, sizes, rng)),
        noise_si=np.array([c.noise_si for c in channels]) * _unequal(channels, sizes, rng),
        skew_s=_by_module(modules, lambda: skew * rng.uniform(-1.0, 1.0)),
        step_v=finest_steps(channels)
        * _by_module(modules, lambda: 2.0 ** round(rng.uniform(0.0, lost_bits))),
        mains_amplitude=mains,
        mains_phase=rng.uniform(0.0, 2.0 * math.pi, n),
        cable=np.where(rng.uniform(size=n) < _CABLES_THAT_MOVE, rng.uniform(0.3, 1.0, n), 0.0),
    )
    return replace(installation, faults=(*installation.faults, *_not_straight(rig, sizes, rng)))


def _not_straight(rig: Rig, sizes: Sizes, rng: np.random.Generator) -> Iterator[Fault]:
    """What the lines of the LVDTs' data sheets leave: each is off by a share of its range in two forms."""
    if share := sizes.get("lvdt_straightness", 0.0):
        for channel in rig.channels:
            if channel.family == "lvdt":
                odd, even = rng.standard_normal(2).tolist()
                yield Fault("not_straight", {"odd": share * odd, "even": share * even}, (channel.id,))


def _as_it_stands(channel: Channel, sizes: Sizes, rng: np.random.Generator) -> Channel:
    error = sizes.get("anchor_error", 0.0) * rng.standard_normal(3)
    slower = 1.0 + sizes.get("tilt_constant", 0.0) * rng.uniform(-1.0, 1.0)
    update: dict[str, object] = {}
    if channel.anchor_m is not None:
        update["anchor_m"] = tuple(float(a + e) for a, e in zip(channel.anchor_m, error, strict=True))
    if channel.family == "tiltmeter":
        update["time_constant_s"] = channel.time_constant_s * slower
    return channel.model_copy(update=update)


def _ordinary_faults(rig: Rig, sizes: Sizes, rng: np.random.Generator) -> list[Fault]:
    faults = []
    for channel in rig.channels:
        turn, play, sag = rng.standard_normal(), rng.uniform(0.1, 1.0), rng.uniform(-1.0, 1.0)
        if "mount_angle" in sizes and channel.family in ("accelerometer", "tiltmeter"):
            faults.append(Fault("turned_mount", {"angle_rad": sizes["mount_angle"] * turn}, (channel.id,)))
        if "wire_backlash" in sizes and channel.family == "wire":
            faults.append(Fault("backlash", {"play_m": sizes["wire_backlash"] * play}, (channel.id,)))
        if "wire_sag" in sizes and channel.family == "wire":
            faults.append(Fault("wire_sag", {"kappa_1_m": sizes["wire_sag"] * sag}, (channel.id,)))
    if "crosstalk" in sizes:
        faults.append(Fault("crosstalk", {"share": sizes["crosstalk"]}, rig.channel_ids))
    return faults


def _unequal(channels: tuple[Channel, ...], sizes: Sizes, rng: np.random.Generator) -> FloatArray:
    largest = math.log(sizes.get("unequal_noise", 1.0))
    family = {name: rng.uniform(-1.0, 1.0) for name in sorted({c.family for c in channels})}
    alone = rng.uniform(-1.0, 1.0, len(channels))
    common = np.array([family[c.family] for c in channels])
    return np.asarray(np.exp(largest * (_FAMILY_SHARE * common + (1.0 - _FAMILY_SHARE) * alone)))


def _by_module(modules: list[str], draw: Callable[[], float]) -> FloatArray:
    value = {name: draw() for name in sorted(set(modules))}
    return np.array([value[name] for name in modules])

"""Predicted ring-downs: bending and turning of the wall as every family shows them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.block import Block, Shares
from daq_app.gap.rocking_model.features.differences import difference_of
from daq_app.gap.rocking_model.features.oscillations.rings import forced_column, ring_columns
from daq_app.gap.rocking_model.features.response import delay, transfer
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.motion.rotation import shown_by_wires


def _ring_coefficients(
    run: RockingRun, block: Block, ring: Block, values: Mapping[str, float]
) -> list[complex]:
    """Per coefficient of the block, what its family's readings show of the motion that `ring` is of: the
    imaginary part of c exp(rate · t) has the sine Re c and the cosine Im c; accelerations over ω².
    The impacts are where the reference shows them, as late as it is.
    """
    coefficients = [0.0j] * len(block.shares)
    motion = _kicked(run, ring, values)
    if not any(motion):
        return coefficients
    frequency, zeta, _ = ring.ring
    natural = 2.0 * np.pi * frequency
    rate = natural * (-zeta + 1j * np.sqrt(1.0 - zeta**2))
    for k, (name, shares) in enumerate(zip(block.names, block.shares, strict=False)):
        family = _family(name)
        undone = block.undone_s if family == "accelerometer" else 0.0
        early = np.exp(rate * (undone + delay(run.reference, values)))
        twice = -((1.0 - 2.0 * zeta**2) + 2j * zeta) if family == "accelerometer" else 1.0
        coefficients[k] = _size(shares, motion) * twice * transfer(rate, family, values) * early
    return coefficients


def _family(coefficient: str) -> str:
    """``sine in wires`` → ``wire``."""
    return coefficient.partition(" in ")[2].removesuffix("s")


def _forced(values: Mapping[str, float]) -> float:
    """Share of the wall's own inertia in what makes it bend, against kicks of the impacts alone."""
    return values.get("flexible_wall.forced", 0.0)


class _Motion(NamedTuple):
    """Sizes of a ring-down by what moves."""

    bend: float = 0.0
    base: float = 0.0
    """Rotation of the base against the bending."""
    yaw: float = 0.0
    twist: float = 0.0


def recoil(run: RockingRun, values: Mapping[str, float]) -> float:
    """Rotation of the base, rad, while the top bends by 1 m.

    A wall that is free to turn about its edge keeps its angular momentum: what its upper part turns one way,
    all of it turns the other way (a pinned-free beam, Blevins 1979).
    """
    return -values.get("flexible_wall.recoil", 0.0) / run.survey.height_m


def _rung(run: RockingRun, ring: Block, values: Mapping[str, float]) -> _Motion:
    """How far the wall rings, as means over the intervals of the grid show it."""
    frequency, _, rate = ring.ring
    mean = float(np.sinc(frequency / rate))
    if ring.kind == "bending":
        bend = mean * values.get("flexible_wall.gain", 0.0)
        return _Motion(bend=bend, base=recoil(run, values) * bend)
    mean /= 2.0 * np.pi * frequency
    return _Motion(yaw=mean * values.get("yaw.kick", 0.0), twist=mean * values.get("twist.kick", 0.0))


def _kicked(run: RockingRun, ring: Block, values: Mapping[str, float]) -> _Motion:
    """The sine in it: inertia bends a wall against the jump of its speed."""
    motion, share = _rung(run, ring, values), 1.0 - 2.0 * _forced(values)
    return motion._replace(bend=share * motion.bend, base=share * motion.base)


def _size(shares: Shares, motion: _Motion) -> float:
    """Size of a motion in a signal of these shares."""
    turns = shares.yaw * motion.yaw + shares.twist * motion.twist
    return shares.bend * motion.bend + shares.rotation * motion.base + turns


def _put(
    run: RockingRun, block: Block, values: Mapping[str, float], frequency: float, zeta: float
) -> FloatArray:
    """The coefficients of a ring-down as numbers, with those of the oscillator."""
    seen = _ring_coefficients(run, block, block, values)
    waves = [c.real if k % 2 == 0 else c.imag for k, c in enumerate(seen)]  # sine and cosine in turns
    coefficients = np.array([*waves, frequency, zeta])
    if zeta != block.ring[1]:
        coefficients *= _faded(block, zeta)
    return coefficients + _of_the_other(run, block, values)


_EVEN = 1e-9
"""Share below which sensors stand evenly, and what rounding leaves is none."""


def _of_the_other(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """What turns in the signals of bending, what bends in those of turning.

    Sensors on both sides of the middle keep them apart; with one of them left out they do not.
    """
    coefficients = np.zeros(len(block.names))
    other = next((b for b in run.blocks if b.ring[0] and b.kind != block.kind), None)
    motion = _Motion() if other is None else _kicked(run, other, values)
    if other is None or not any(abs(_size(shares, motion)) > _EVEN for shares in block.shares):
        return coefficients
    frequency, zeta, _ = other.ring
    columns = run.cache.constant(
        (block.family, "the other ring"),
        lambda: block.projection @ ring_columns(run.grid, frequency, zeta),
    )
    for k, c in enumerate(_ring_coefficients(run, block, other, values)):
        size = (2.0 * np.pi * frequency) ** 2 if block.names[k].endswith("accelerometers") else 1.0
        coefficients[k] = size * float(columns[k] @ (c.real, c.imag))
    return coefficients


def bent_wall(run: RockingRun, values: Mapping[str, float]) -> Mapping[str, float]:
    """How much of each of its forms (`bent_form`) the bending of the wall's top has; empty for none."""
    gain = values.get("flexible_wall.gain", 0.0)
    if gain == 0.0 or not any(block.kind == "bending" for block in run.blocks):
        return {}
    forced = _forced(values)
    return {"kicked": gain * (1.0 - 2.0 * forced), "forced": -gain * forced}


def bent_form(run: RockingRun, name: str) -> FloatArray:
    """One form of the bending, m at the top for a strength of one, on the grid, at the ring that is shown."""
    frequency, zeta, rate = next(block.ring for block in run.blocks if block.kind == "bending")
    if name == "kicked":
        return np.asarray(np.sinc(frequency / rate) * ring_columns(run.grid, frequency, zeta)[:, 0])
    return forced_column(run.grid, frequency, zeta, accelerations=False)


def kicks_that_turn(run: RockingRun, values: Mapping[str, float]) -> dict[str, float]:
    """Parameter → kick to yaw and twist, for runs that show a ring-down of either; empty for none."""
    kicks = {key: values.get(key, 0.0) for key in ("yaw.kick", "twist.kick")}
    shown = any(kicks.values()) and any(block.kind == "turning" for block in run.blocks)
    return {key: kick for key, kick in kicks.items() if kick != 0.0} if shown else {}


def turning_wave(run: RockingRun) -> FloatArray:
    """The ring-down of yaw or twist for a kick of one, on the grid, at the ring that is shown."""
    frequency, zeta, rate = next(block.ring for block in run.blocks if block.kind == "turning")
    wave = np.sinc(frequency / rate) * ring_columns(run.grid, frequency, zeta)[:, 0]
    return np.asarray(wave / (2.0 * np.pi * frequency))


def bent_share(run: RockingRun, *, of_base: bool) -> float:
    """What a top that bends by 1 m makes of the wires' mean rotation (weights z²), rad, or of the base, m."""

    def share() -> float:
        z = np.array([wire.sensor.position_m[2] for wire in run.wires])
        return shown_by_wires(run.wires, (z / run.survey.height_m) ** 2, of_base=of_base)

    return run.cache.constant(("bent share", of_base), share)


def bending(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """Ring-down of a cantilever mode, and what effects on the wires look like in the same columns."""
    # Bending is told against the rotation of the reference; wires as the reference show none of it.
    wires = None if run.reference == "wire" else difference_of(run, "wire", "lvdt", values)
    frequency, zeta, _ = block.ring
    oscillator = (values.get("flexible_wall.frequency", frequency), values.get("flexible_wall.zeta", zeta))
    return _put(run, block, values, *oscillator) + _forced_ring(run, block, values) + _in_wires(block, wires)


def _forced_ring(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """What the part of a bending that the wall's own inertia forces looks like as sine and cosine."""
    coefficients = np.zeros(len(block.names))
    if not (forced := _forced(values)):
        return coefficients
    motion = _rung(run, block, values)
    for k, (name, shares) in enumerate(zip(block.names, block.shares, strict=False)):
        family = _family(name)
        columns = run.cache.constant(
            (block.family, "forced", family), partial(_forced_columns, run, block, family)
        )
        coefficients[k] = -forced * _size(shares, motion) * float(columns[k])
    return coefficients


def _forced_columns(run: RockingRun, block: Block, family: str) -> FloatArray:
    """What all coefficients make of the forced ring of unit size as a family shows it, (k,)."""
    frequency, zeta, _ = block.ring
    accelerations = family == "accelerometer"
    return block.projection @ forced_column(run.grid, frequency, zeta, accelerations=accelerations)


def turning(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """Ring-down of yaw (the wall turns about the vertical) or of twist (θ differs along the length)."""
    # Evenly placed wires show nothing of an error of their rotation in what turns.
    uneven = run.reference != "wire" and _shows_rotation(block)
    wires = difference_of(run, "wire", "lvdt", values) if uneven else None
    frequency, zeta, _ = block.ring
    other = "yaw" if "yaw.kick" in values else "twist"
    oscillator = (values.get(f"{other}.frequency", frequency), values.get(f"{other}.zeta", zeta))
    return _put(run, block, values, *oscillator) + _in_wires(block, wires)


def _shows_rotation(block: Block) -> bool:
    """Whether an error of the wires' rotation shows in a ring-down's signals."""
    return any(
        n.endswith("in wires") and abs(s.rotation) > _EVEN
        for n, s in zip(block.names, block.shares, strict=False)
    )


def _faded(block: Block, zeta: float) -> FloatArray:
    """Size of each coefficient, made with the block's damping, of a ring-down with another damping."""
    factors = np.ones(len(block.names))
    factors[: len(block.fading)] += np.array(block.fading) * np.log(zeta / block.ring[1])
    return factors


def _in_wires(block: Block, series: FloatArray | None) -> FloatArray:
    """What a difference of the wires' rotation, if any, makes of the columns read from wires."""
    coefficients = np.zeros(len(block.names))
    if series is not None:
        for k, name in enumerate(block.names):
            if name.endswith("in wires"):
                coefficients[k] = block.shares[k].rotation * float(block.projection[k] @ series)
    return coefficients

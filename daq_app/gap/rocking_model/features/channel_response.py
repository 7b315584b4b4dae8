"""Predicted coefficients of one channel that is examined on its own."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.features.oscillations.ring_response import (
    bent_form,
    bent_wall,
    kicks_that_turn,
    turning_wave,
)
from daq_app.gap.rocking_model.features.response import effects_on, responded
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.slips.impact_steps import stepped, turns
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ, TAIL_S, Wire, coarse, straight_line
from daq_app.gap.rocking_model.records import Sensor


def _rotation(block: Block) -> FloatArray:
    """What the other wires say of the rotation."""
    assert block.expected is not None
    assert block.wire is not None
    return block.expected / block.wire.sensor.position_m[2]


def channel(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """Coefficients of one channel against its family, and the logarithm of what they leave over noise."""
    assert block.expected is not None
    assert block.design is not None
    # A wire's faults act on its length, of which its height times the rotation is a curved picture.
    true = block.expected if block.wire is None else block.wire.shortening(_rotation(block))
    total: FloatArray | None = None
    for effect, value in effects_on(block.family, values).items():
        if effect == "wire_anchor":
            assert block.wire is not None
            series = block.wire.shortening(_rotation(block), value) - true
        elif block.finer is not None:
            finer, rate_hz = block.finer
            series = coarse(responded(finer, effect, value, block.family, values, rate_hz) - finer, rate_hz)
        else:
            series = responded(true, effect, value, block.family, values) - true
        total = series if total is None else total + series
    coefficients = np.zeros(len(block.names))
    apart = _moved_apart(run, block, values)
    if total is not None or apart is not None:
        total = np.zeros_like(true) if total is None else total
        if block.wire is not None:
            # The zero of every channel is its rest at the end of the record.
            total = total - total[-round(TAIL_S * GRID_HZ) :].mean()
            total = block.wire.sensor.position_m[2] * block.wire.rotation(true + total) - block.expected
        total = total if apart is None else total + apart
        seen = total[block.pick]
        coefficients[:-1] = block.projection @ seen
        left = seen - block.design @ (block.design.T @ seen)
        coefficients[-1] = 0.5 * np.log1p(float(left @ left) / seen.size / block.noise**2)
    for k, shape in enumerate(block.names[: len(block.levers)]):
        coefficients[k] += values.get(f"cal_{block.family}_{shape}", 0.0)
    return coefficients


def _moved_apart(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray | None:
    """By what a wall that rings or turns moves a wire beyond what the others make of it, m; None: nothing.

    They stand at other heights and on other sides, so it does not cancel as a rotation does.
    """
    if block.wire is None:
        return None
    sizes = dict(bent_wall(run, values))
    sizes |= kicks_that_turn(run, values) | turns(run, values)
    parts = []
    for form, size in sizes.items():
        if size == 0.0:
            continue
        make = partial(_form_of_one, run, block.wire, form)
        parts.append(size * run.cache.constant((block.family, form), make))
    return np.asarray(np.sum(parts, axis=0)) if parts else None


def _form_of_one(run: RockingRun, wire: Wire, form: str) -> FloatArray:
    """The same of one form, for a strength of one, at the frequency and damping that the runs show."""
    if form in ("yaw.kick", "twist.kick"):
        wave = turning_wave(run)
    elif form.startswith("corner_twist"):
        wave = stepped(run, form)
    else:
        wave = bent_form(run, form)

    def moved(sensor: Sensor) -> float:
        _, y, z = sensor.position_m
        if "." not in form:
            return float((z / run.survey.height_m) ** 2)
        return float(y * z if form.startswith("twist") else -y)

    others = [w.sensor for w in run.wires if w.sensor.id != wire.sensor.id]
    heights = np.array([sensor.position_m[2] for sensor in others])
    weights = np.array([1.0, wire.sensor.position_m[2]]) @ straight_line(heights)
    beyond = moved(wire.sensor) - float(weights @ np.array([moved(sensor) for sensor in others]))
    return np.asarray(beyond * wave)

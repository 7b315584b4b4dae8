"""From the channels of a rig to the rows of the kernels, with each sensor's own imperfections."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Channel, Rig
from sim_hardware.sensors import layout as la
from sim_hardware.sensors.noise import generator

IEPE_CORNER_HZ: Final = 0.5
"""Lower corner of an IEPE sensor on an AC-coupled input (NI 9234)."""
RING_M_S2: Final = 110.0
"""Ringing of an accelerometer per rad/s of approach: several g for the first impacts of a test."""
FLOATING_NOISE_V: Final = 2e-3
ROOM_DEG_C: Final = 20.0
"""What thermometers of the simulated laboratory show; nothing pulls, strains or commands there."""
_LEVELLED_RAD: Final = 8e-3
"""A tiltmeter is levelled to within half a degree when it is mounted, however wide its range."""

_AXIS: Final = {"x": la.AXIS_X, "y": la.AXIS_Y, "z": la.AXIS_Z}
_RING_BY_AXIS: Final = {"x": 1.0, "y": 0.2, "z": 1.3}
_DEFAULT_TIME_CONSTANT_S: Final = 0.3


def blank_row() -> NDArray[np.float64]:
    """A terminal with nothing wired to it: near 0 V, with a little noise and hum."""
    row = np.zeros(la.N_ROW)
    row[la.RW_SLOPE] = row[la.RW_GAIN] = row[la.RW_CLOCK] = 1.0
    row[la.RW_LOW], row[la.RW_HIGH], row[la.RW_STUCK] = -math.inf, math.inf, math.inf
    row[la.RW_TABLE] = -1.0
    row[la.RW_DROP_S] = 1.0
    row[la.RW_NOISE] = FLOATING_NOISE_V
    row[la.RW_HUM], row[la.RW_HUM_W] = FLOATING_NOISE_V, 100.0 * math.pi
    return row


def excitation_v(channel: Channel) -> float:
    """Excitation to divide the sensor's volts by: native LVDTs are given per volt of excitation."""
    if channel.measurement == "lvdt_native" and channel.sensitivity_unit != "mV/V/mm":
        return channel.excitation.value or 1.0
    return 1.0


def sensor_row(channel: Channel, height_m: float, offset_scatter: float, seed: int) -> NDArray[np.float64]:
    """The row of one sensor: what the rig file says, plus what differs from sensor to sensor."""
    row = blank_row()
    rng = generator(seed, channel.id, "sensor")
    row[la.RW_HUM] = 0.0
    row[la.RW_FAMILY] = la.FAMILY_CODE.get(channel.family, la.CONSTANT)
    row[la.RW_X : la.RW_X + 3] = channel.position_m
    if channel.anchor_m is not None:
        row[la.RW_ANCHOR : la.RW_ANCHOR + 3] = channel.anchor_m
    row[la.RW_AXIS] = _AXIS[channel.axis]
    slope = channel.sensitivity_v_per_si / excitation_v(channel)
    row[la.RW_SLOPE] = channel.polarity * slope
    row[la.RW_ZERO] = channel.offset * (slope if channel.scaled_by_driver else 1.0)
    row[la.RW_NOISE] = channel.noise_si
    low, high = channel.range_si
    iepe = channel.measurement == "iepe"
    scatter = offset_scatter * (high - low) * rng.standard_normal()
    if channel.family == "tiltmeter":
        scatter = min(max(scatter, -_LEVELLED_RAD), _LEVELLED_RAD)
    # An AC-coupled sensor shows no offset, and one whose zero is never taken must have none.
    row[la.RW_OFFSET] = 0.0 if iepe or not channel.zeroed else scatter
    if channel.family == "temperature":
        row[la.RW_OFFSET] = ROOM_DEG_C
    row[la.RW_LOW], row[la.RW_HIGH] = low, high
    if channel.family == "accelerometer":
        _ring(row, channel, height_m, rng)
        if iepe:
            row[la.RW_FILTER] = la.HIGH_PASS
            row[la.RW_FILTER_A] = 1.0 / (2.0 * math.pi * IEPE_CORNER_HZ)
    elif channel.family == "tiltmeter":
        row[la.RW_FILTER] = la.LOW_PASS
        row[la.RW_FILTER_A] = channel.time_constant_s or _DEFAULT_TIME_CONSTANT_S
        row[la.RW_CROSS] = rng.normal(0.0, 0.005)
    elif channel.time_constant_s > 0.0:
        row[la.RW_FILTER], row[la.RW_FILTER_A] = la.LOW_PASS, channel.time_constant_s
    return row


def _ring(row: NDArray[np.float64], channel: Channel, height_m: float, rng: np.random.Generator) -> None:
    """Two modes of 100–400 Hz, heard louder low on the wall, gone after 10–20 ms."""
    reach = 1.0 - 0.5 * channel.position_m[2] / height_m
    loud = RING_M_S2 * _RING_BY_AXIS[channel.axis] * reach * rng.uniform(0.8, 1.2)
    low, high = rng.uniform(100.0, 190.0), rng.uniform(220.0, 400.0)
    row[la.RW_RING : la.RW_RING + 3] = 0.6 * loud, 2.0 * math.pi * low, 1.0 / rng.uniform(0.005, 0.008)
    row[la.RW_RING + 3 : la.RW_RING + 6] = 0.4 * loud, 2.0 * math.pi * high, 1.0 / rng.uniform(0.003, 0.005)


def sensor_rows(rig: Rig, seed: int) -> NDArray[np.float64]:
    """(n, N_ROW) in the order of the rig file."""
    scatter, height = rig.simulation.offset_scatter, rig.specimen.height_m
    return np.stack([sensor_row(channel, height, scatter, seed) for channel in rig.channels])


def number_tables(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give each row with dynamics its place in the filter tables; returns those rows, (k, N_ROW)."""
    dynamic = np.flatnonzero(rows[:, la.RW_FILTER] != la.NO_FILTER)
    rows[dynamic, la.RW_TABLE] = np.arange(dynamic.size)
    return rows[dynamic].copy()


def special_rows(rows: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(n,) rows that see the wall at other instants than the sample clock's."""
    special = (rows[:, la.RW_DELAY] != 0.0) | (rows[:, la.RW_DROP_SHARE] > 0.0)
    special |= (rows[:, la.RW_CLOCK] != 1.0) | np.isfinite(rows[:, la.RW_STUCK])
    return np.asarray(special)


def channel_index(channels: Sequence[Channel]) -> dict[str, int]:
    """Terminal → place in the rig file."""
    return {channel.physical_channel: i for i, channel in enumerate(channels)}

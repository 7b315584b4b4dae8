"""Are the channels what the rig file says? Reversed polarity and exchanged plugs, before anything is fitted.

Every channel is compared with what the rotation implies at its place; the rotation is a median over
many channels, so that a few wrong ones cannot spoil it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.signal import butter, sosfiltfilt

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.response import first_order
from daq_app.gap.rocking_model.motion.late_joint import common_lateness
from daq_app.gap.rocking_model.motion.rotation import opening, rotation_of_faces, zeroed
from daq_app.gap.rocking_model.records import GRAVITY_M_S2, GapRun, Sensor, Wiring
from daq_app.gap.rocking_model.tolerances.inspection import (
    EXCHANGE_EACH,
    EXCHANGE_GAIN,
    EXCHANGE_GAINS,
    EXCHANGE_LEAST,
    EXCHANGE_MISFIT,
    FAR_FROM_UPRIGHT,
    LIVELY,
    REVERSED_BELOW,
    WITHIN_RANGE,
)
from daq_app.rocking.means import means_over

WORK_HZ = 100.0
LOW_PASS_HZ = 12.0
"""Impacts ring above this."""


@dataclass(frozen=True, slots=True)
class _Seen:
    """Channels of one run that follow the rotation, smoothed and thinned out: what they show, and should."""

    measured: FloatArray
    """(k, n)"""
    expected: FloatArray
    """(k, n)"""
    ids: list[str]

    def of(self, run: GapRun, group: list[str]) -> tuple[FloatArray, FloatArray]:
        """(shown, due) of channels of one kind, (k, n) each."""
        at = [self.ids.index(name) for name in group]
        measured, expected = self.measured[at], self.expected[at]
        # What is read away from impacts only has the edges of that choice, which are late with nothing.
        away = _away_from_impacts(run.sensors[run.place(group[0])])
        return measured, expected if away else _as_late_as(measured, expected)


def mend(runs: list[GapRun]) -> tuple[list[GapRun], Wiring]:
    """Runs with reversed channels turned round and exchanged ones put back, and what was done."""
    seen = [_compare(run) for run in runs]
    ids = [name for name in seen[0].ids if all(name in one.ids for one in seen)]
    exchanged: list[tuple[str, str]] = []
    places = 0
    for group in _groups(runs[0], ids):
        shown = [one.of(run, group) for run, one in zip(runs, seen, strict=True)]
        order, turn = _order_of_all(shown, _moves(runs[0], group))
        exchanged += [(group[i], group[j]) for i, j in enumerate(order) if i != j]
        places = max(places, turn)
    turned = [_turned(run, one) for run, one in zip(runs, seen, strict=True)]
    involved = {name for pair in exchanged for name in pair}
    reversed_ids = [n for n in ids if n not in involved and all(n in names for names in turned)]
    kept = Wiring(tuple(reversed_ids), tuple(exchanged), places)
    if kept == Wiring():
        return runs, kept
    return [_mended(run, kept) for run in runs], kept


def _mended(run: GapRun, wiring: Wiring) -> GapRun:
    place = {sensor.id: i for i, sensor in enumerate(run.sensors)}
    channels, sensors, offsets = run.channels.copy(), list(run.sensors), run.time_offset_s.copy()
    for name in wiring.reversed_ids:
        at = place[name]
        channels[at] *= -1.0
        # The next channel that is scanned still sees the voltage that was there.
        sensors[at] = replace(sensors[at], si_per_reading=-sensors[at].si_per_reading)
    for terminal, sensor in wiring.exchanged:
        channels[place[sensor]] = run.channels[place[terminal]]
        if offsets.size:
            offsets[place[sensor]] = run.time_offset_s[place[terminal]]
    if not wiring.exchanged:
        return replace(run, channels=channels, sensors=tuple(sensors))
    moved = {place[terminal]: place[sensor] for terminal, sensor in wiring.exchanged}
    came = {now: then for then, now in moved.items()}
    # A plug is scanned when it is scanned, and after the same one, wherever its sensor is put back.
    scanned = [came.get(i, i) - 1 for i in range(len(sensors))]
    before = tuple(moved.get(then, then) for then in scanned)
    return replace(
        run, channels=channels, sensors=tuple(sensors), time_offset_s=offsets, scanned_before=before
    )


def _turned(run: GapRun, seen: _Seen) -> list[str]:
    """Channels that show the opposite of what they should."""
    size = np.sum(seen.expected**2, axis=1)
    # A channel that should show next to nothing cannot be judged by its slope.
    lively = size > LIVELY * np.median(size) if size.size else size > 0.0
    return [
        name
        for name, y, e, alive in zip(seen.ids, seen.measured, seen.expected, lively, strict=True)
        if alive and _slope(run, name, y, e) < REVERSED_BELOW
    ]


def _slope(run: GapRun, name: str, measured: FloatArray, expected: FloatArray) -> float:
    """Slope of a channel on what it should show, away from the ends of its range.

    A reversed LVDT runs into its stop at once: only what it shows before that tells its sign.
    """
    low, high = run.sensors[run.place(name)].range_si
    free = (
        (measured > WITHIN_RANGE * low) & (measured < WITHIN_RANGE * high)
        if np.isfinite([low, high]).all()
        else measured < np.inf
    )
    power = float(expected[free] @ expected[free])
    return float(measured[free] @ expected[free]) / max(power, 1e-30)


def _groups(run: GapRun, ids: list[str]) -> list[list[str]]:
    """Channels that could be plugged into each other's terminals: one family, one axis.

    The two axes of a tiltmeter are two plugs of one instrument, of which one shows next to nothing.
    """
    kinds: dict[tuple[str, str], list[str]] = {}
    for sensor in run.sensors:
        if sensor.id in ids:
            axis = "" if sensor.family == "tiltmeter" else sensor.axis
            kinds.setdefault((sensor.family, axis), []).append(sensor.id)
    return list(kinds.values())


def _moves(run: GapRun, group: list[str]) -> FloatArray:
    """What each terminal (rows) must lose of its misfit to count as moved to each sensor (columns), (k, k).

    Half as much where both are axes of one instrument, whose plugs lie beside each other.
    """
    positions = run.positions([run.place(name) for name in group])
    same = np.all(positions[:, None] == positions[None, :], axis=2)
    return EXCHANGE_EACH * np.where(same, 0.5, 1.0) * (1.0 - np.eye(len(group)))


def _as_late_as(measured: FloatArray, expected: FloatArray) -> FloatArray:
    """What channels of one kind should show, (k, n), as late as they show it together.

    Exchanged plugs move no corner in time: a family that is late is late at whatever terminal. What is due
    nothing may show what is due most.
    """
    due = np.ptp(expected, axis=1)
    compared = np.where(due[:, None] > 0.0, expected, expected[np.argmax(due)])
    late = common_lateness(measured, compared, WORK_HZ)
    at = np.arange(expected.shape[1])
    return np.array([np.interp(at - late, at, row) for row in expected])


def _order_of_all(shown: list[tuple[FloatArray, FloatArray]], moves: FloatArray) -> tuple[list[int], int]:
    """The order of all runs together: a test with small rotations says little, and overrules no other.

    None where plugs are elsewhere in some test: there the order fits worse than none.
    """
    order, turn = _order(_misfits(*(np.hstack(rows) for rows in zip(*shown, strict=True))), moves)
    at = np.arange(len(order))
    moved = at != order
    if not moved.any():
        return order, turn
    for measured, due in shown:
        misfit = _misfits(measured, due)
        if misfit[at, order][moved].sum() > misfit[at, at][moved].sum():
            return at.tolist(), 0
    return order, turn


def _order(misfit: FloatArray, moves: FloatArray) -> tuple[list[int], int]:
    """(which sensor each terminal shows, places turned round) from misfits of terminals (rows) as sensors.

    The order with the smallest misfit of all, if it makes sense of what makes no sense as it is. A channel
    that shows no sensor of its kind says nothing about where the others are plugged.
    """
    n = len(misfit)
    order = list(range(n))
    known = np.flatnonzero(misfit.min(axis=1) < EXCHANGE_MISFIT)
    table = misfit[np.ix_(known, known)]
    if known.size < 2 or float(np.trace(table)) <= EXCHANGE_LEAST:
        return order, 0
    at = np.arange(known.size)
    _, best = linear_sum_assignment(table + moves[np.ix_(known, known)])
    # Those that stay where they are misfit before and after: they say nothing about the others' plugs.
    moved = at != best
    straight, after = float(table[at, at][moved].sum()), float(table[at, best][moved].sum())
    if straight <= EXCHANGE_LEAST or after >= EXCHANGE_GAIN * straight:
        return order, 0
    left = float(table[at, best].sum())
    for i, j in zip(known, known[best], strict=True):
        order[int(i)] = int(j)
    turned = [float(np.trace(np.roll(misfit, k, axis=1))) for k in range(1, n)]
    # Sensors that show the same may be exchanged or not: the turn that fits as well is the simpler story.
    fits = [k for k, total in enumerate(turned, start=1) if known.size == n and total < left + EXCHANGE_EACH]
    return order, fits[0] if fits else 1


def _misfits(measured: FloatArray, expected: FloatArray) -> FloatArray:
    """Share of the power of each signal (rows) that what is expected of each sensor (columns), with a gain
    within 15 % of 1, leaves unexplained; both (k, n).

    What a sensor shows of which nothing is due counts as a share of the most that is due of any.
    """
    power, due = np.sum(measured**2, axis=1)[:, None], np.sum(expected**2, axis=1)
    product = measured @ expected.T
    gain = np.clip(product / np.maximum(due, 1e-30), *EXCHANGE_GAINS)
    left = power - 2.0 * gain * product + gain**2 * due
    most = np.where(due > 0.0, due, due.max())
    return np.asarray(left / np.maximum(np.maximum(power, most), 1e-30))


def _compare(run: GapRun) -> _Seen:
    """All channels that follow the rotation."""
    step = max(round(run.rate_hz / WORK_HZ), 1)
    low_pass = butter(3, LOW_PASS_HZ, fs=WORK_HZ, output="sos")
    reading = np.flatnonzero(np.isfinite(run.channels).all(axis=1)).tolist()
    thinned = np.array([means_over(zeroed(run, i), step) for i in reading])
    smooth = dict(zip(reading, sosfiltfilt(low_pass, thinned), strict=True)) if reading else {}
    theta = _median_rotation(run, smooth)
    if theta is None:
        return _Seen(np.zeros((0, 0)), np.zeros((0, 0)), [])
    speed = np.gradient(theta, step / run.rate_hz)
    motion = (theta, speed, np.gradient(speed, step / run.rate_hz))
    away = np.abs(theta) > FAR_FROM_UPRIGHT * np.max(np.abs(theta))
    measured, expected, ids = [], [], []
    for i, values in smooth.items():
        shape = _expected(run, i, *motion)
        if shape is not None:
            seen = away if _away_from_impacts(run.sensors[i]) else 1.0
            measured.append(values * seen)
            expected.append(shape * seen)
            ids.append(run.sensors[i].id)
    return _Seen(np.array(measured), np.array(expected), ids)


def _away_from_impacts(sensor: Sensor) -> bool:
    """An accelerometer along z shows more of an impact than of all rocking between impacts."""
    return sensor.family == "accelerometer" and sensor.axis == "z"


def _median_rotation(run: GapRun, smooth: dict[int, FloatArray]) -> FloatArray | None:
    """θ from the medians of both faces; from the wires where there are no LVDTs."""
    lvdts = [i for i in run.indices("lvdt") if i in smooth]
    openings, x_m = [smooth[i] for i in lvdts], run.positions(lvdts)[:, 0].tolist()
    theta = rotation_of_faces(openings, x_m, run.survey.half_base_m, fewest=3)
    if theta is not None:
        return theta
    wires = [smooth[i] / run.sensors[i].position_m[2] for i in run.indices("wire") if i in smooth]
    return np.asarray(np.median(wires, axis=0), dtype=float) if len(wires) >= 3 else None


def _expected(
    run: GapRun, i: int, theta: FloatArray, speed: FloatArray, acceleration: FloatArray
) -> FloatArray | None:
    """What a channel shows of a rotation of small size; None for one that sees none of it."""
    sensor = run.sensors[i]
    x, _, z = sensor.position_m
    half = run.survey.half_base_m
    match sensor.family:
        case "lvdt":
            return opening(theta, x, half)
        case "wire":
            toward = 1.0 if sensor.anchor_m is None or sensor.anchor_m[0] > x else -1.0
            return toward * z * theta
        case "accelerometer" if sensor.axis == "x" and not sensor.ac_coupled:
            return z * acceleration - GRAVITY_M_S2 * theta - speed**2 * (x - half * np.sign(theta))
        case "accelerometer" if sensor.axis == "z" and not sensor.ac_coupled:
            return -acceleration * (x - half * np.sign(theta))
        case "tiltmeter" if sensor.axis == "x":
            return first_order(theta, sensor.time_constant_s, WORK_HZ)
        case "tiltmeter":
            return np.zeros_like(theta)  # a wall that rocks on its long edges does not turn about that axis
    return None

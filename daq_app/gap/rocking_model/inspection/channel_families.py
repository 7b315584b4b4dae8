"""Channels of a family on the grid, and each as the others of its family predict it, by geometry alone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.signal import oaconvolve

from daq_app.campaign.report.statistics import random_effects_mean
from daq_app.config.rig import Family
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.channel_shapes import FURTHER, TOLERANCE, Others, shape_columns
from daq_app.gap.rocking_model.features.noise import coefficient_covariance
from daq_app.gap.rocking_model.motion.crosstalk import UNKNOWN_LEAK, Leak, crosstalk
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rigid_body import across_axes
from daq_app.gap.rocking_model.motion.rotation import coarse, gridded, sooner, wall_rotation, zeroed
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.motion import AROUND_TEST_S
from daq_app.gap.rocking_model.tolerances.sensors import CALIBRATION, CROSSTALK, LEAKS_DIFFER, MOUNT_RAD

_SMOOTH_S = 0.04
"""Window over which accelerations are averaged: with 30 ms of ringing it stays within the mask of 50 ms."""


@dataclass(frozen=True, slots=True)
class ChannelFamily:
    """Signals of a family on the grid with their geometry: signals ≈ design @ motion, row by row."""

    ids: tuple[str, ...]
    signals: FloatArray
    design: FloatArray
    pick: NDArray[np.bool_]
    step: float = 0.0
    repeats: int = 1
    further: tuple[str, ...] = ()
    leaked: FloatArray | None = None
    """What one sd of crosstalk from the channel that is scanned before adds to each signal; common to all."""
    turned: FloatArray | None = None
    """What a mount that is turned by one sd adds to each signal; each has an angle of its own."""
    lateral_m: FloatArray | None = None
    """Of wires: how far along the wall each is fixed, (k,)."""

    def untwisted(self) -> ChannelFamily | None:
        """The same of a wall that does not turn about the vertical; None of channels that cannot show it.

        Of two wires beside each other this leaves their mean.
        """
        if self.lateral_m is None:
            return None
        motions = np.column_stack([self.design, self.lateral_m])
        if np.linalg.matrix_rank(motions) < motions.shape[1]:
            return None
        turn = (np.linalg.pinv(motions) @ self.signals)[-1]
        return replace(self, signals=self.signals - self.lateral_m[:, None] * turn)

    def knowing(self, leak: Leak) -> ChannelFamily:
        """The same of a family whose crosstalk was unknown: less what is known of it."""
        if self.leaked is None:
            return self
        whole = self.leaked / CROSSTALK
        return replace(self, signals=self.signals - leak.share * whole, leaked=leak.sd * whole)


def channel_family(
    run: GapRun, grid: Grid, family: Family, step: float = 0.0, include: tuple[str, ...] = ()
) -> ChannelFamily | None:
    """A family of one run, with the channels of `include` though they are excluded; None of too few."""
    whole = run.including(include)
    moving = (grid.time_s > -0.5) & (grid.time_s < grid.rest_s + AROUND_TEST_S)
    match family:
        case "lvdt":
            chosen, pick = [i for i in whole.indices("lvdt") if whole.reads(i)], moving & grid.valid
        case "wire":
            chosen, pick = wall_rotation(whole)[1], moving
        case "accelerometer":
            chosen, pick = whole.steady_accelerometers("x"), moving & ~grid.near_impact
        case _:
            return None
    if len(chosen) < (8 if family == "lvdt" else 4):
        return None
    return ChannelFamily(
        tuple(run.sensors[i].id for i in chosen),
        _signals(whole, family, chosen),
        _design(family, run.positions(chosen)),
        pick,
        step,
        repeats=grid.impact_s.size,
        further=FURTHER[family],
        leaked=CROSSTALK * crosstalk(run, chosen),
        turned=MOUNT_RAD * across_axes(run, grid, chosen) if family == "accelerometer" else None,
        lateral_m=run.positions(chosen)[:, 1] if family == "wire" else None,
    )


def alike_in_all(
    runs: Sequence[GapRun], grids: Sequence[Grid], family: Family, include: Sequence[str]
) -> list[ChannelFamily]:
    """A family of each run (`channel_family`); none of any unless all of them have the same channels."""
    families = [
        channel_family(r, g, family, include=tuple(include)) for r, g in zip(runs, grids, strict=True)
    ]
    data = [one for one in families if one is not None]
    return data if len(data) == len(runs) and all(one.ids == data[0].ids for one in data) else []


def _signals(run: GapRun, family: Family, chosen: Sequence[int]) -> FloatArray:
    """What the channels show, (k, m): wires as the height times the rotation that each sees."""
    if family == "accelerometer":
        return smoothed(run, chosen)
    if family == "wire":
        return run.positions(chosen)[:, 2:] * coarse(wall_rotation(run)[0], run.rate_hz)
    return np.array([gridded(run, i) for i in chosen])


def _design(family: Family, positions_m: FloatArray) -> FloatArray:
    """What a rigid motion has for each channel, (k, 2), of LVDTs (k, 4)."""
    x, y, z = positions_m.T
    if family != "lvdt":
        return np.column_stack([np.ones_like(z), z])
    # A face's calibrations that differ along its length look like a twist, of that face alone.
    return np.column_stack([np.ones_like(x), -x, -x * y * (x < 0), -x * y * (x > 0)])


def beside(data: ChannelFamily, name: str, without: tuple[str, ...]) -> Others:
    """A channel beside what the others of its family, less some, make of it."""
    place = data.ids.index(name)
    others = [i for i, other in enumerate(data.ids) if other != name and other not in without]
    errors = _usual_errors(data)[others]
    weights = data.design[place] @ np.linalg.pinv(data.design[others] / errors[:, None]) / errors
    expected = weights @ data.signals[others]
    all_weights = np.zeros(len(data.ids))
    all_weights[others] = weights
    # A channel far from the others is predicted by a difference of them: their errors grow.
    sizes = np.sqrt(np.mean(data.signals[others] ** 2, axis=1))
    expected_rms = float(np.sqrt(np.mean(expected**2))) + 1e-300
    spread = float(np.sqrt(1.0 + np.sum((weights * sizes / expected_rms) ** 2)))
    curved = float(np.sqrt(1.0 + np.sum((weights * (sizes / expected_rms) ** 2) ** 2)))
    travels = np.sqrt(np.mean(data.signals**2, axis=1))
    slower = (
        max(float(np.median(travels) / (travels[place] + 1e-300)), 1.0) if data.lateral_m is not None else 1.0
    )
    rough = data.step / np.sqrt(12.0) * float(np.sqrt(1.0 + np.sum(weights**2)))
    # The imperfections of the others are in the prediction.
    rows = [] if data.leaked is None else [data.leaked[place] - weights @ data.leaked[others]]
    if data.turned is not None:
        rows += [data.turned[place], *(weights[:, None] * data.turned[others])]
    own_and_others = np.array(rows) if rows else None
    return Others(
        data.signals[place],
        expected,
        data.pick,
        spread,
        curved,
        slower,
        rough,
        data.repeats,
        data.further,
        all_weights,
        own_and_others,
    )


def _usual_errors(data: ChannelFamily) -> FloatArray:
    """What each channel is usually off by, (k,), up to a factor: one that is scanned after another family's
    large voltage says little of the others."""
    usual = CALIBRATION * float(np.sqrt(np.mean(data.signals**2))) + 1e-300
    leaked = 0.0 if data.leaked is None else np.mean(data.leaked**2, axis=1)
    return np.asarray(np.sqrt(usual**2 + leaked) * np.ones(len(data.ids)))


def leak_into_wires(data: Mapping[Family, Sequence[ChannelFamily]], run: GapRun) -> Leak:
    """What the other families, whose crosstalk is unknown, say of that in the wires.

    It shows in a channel that is scanned after one of another family or face, whose signal is like nothing
    that it shows itself. Wires are not asked: an anchor that is off looks like the crosstalk of an LVDT.
    """
    told = [row for family, entries in data.items() if family != "wire" for row in _told(entries, run)]
    return _joint(told)


def _told(entries: Sequence[ChannelFamily], run: GapRun) -> list[tuple[float, float]]:
    """Share of crosstalk with its sd, 1, of each channel of a family that is scanned after another signal."""
    rows = []
    for name in sorted(set.intersection(*(set(entry.ids) for entry in entries))):
        place = run.place(name)
        before = run.before(place)
        if before < 0 or _signal_of(run, before) == _signal_of(run, place):
            continue
        seen = np.array([_share(beside(entry, name, ()), run.sensors[place].family) for entry in entries])
        if np.isfinite(seen).all() and (seen[:, 1] > 0.0).all():
            # What sound channels differ by is the same in all runs: many know it no better than one.
            rows.append((float(np.median(seen[:, 0])), float(np.median(seen[:, 1]))))
    return rows


def _signal_of(run: GapRun, place: int) -> tuple[str, bool]:
    """What a channel shows: its family, of LVDTs the face."""
    sensor = run.sensors[place]
    return sensor.family, sensor.family == "lvdt" and sensor.position_m[0] > 0.0


def _share(other: Others, family: Family) -> tuple[float, float]:
    """Share of crosstalk in what a channel shows beyond the others, with its sd; NaN where none can show.

    Generalised least squares with the shapes in which sound channels differ, by what they differ.
    """
    leaked = np.zeros(0) if other.imperfections is None else other.imperfections[0][other.pick] / CROSSTALK
    if not leaked.any():
        return np.nan, np.nan
    columns = np.column_stack([shape_columns(other), leaked])
    scale = np.sqrt(np.mean(columns**2, axis=0)) + 1e-300
    inverse = np.linalg.pinv(columns / scale, rcond=1e-9) / scale[:, None]
    difference = (other.measured - other.expected)[other.pick]
    values = inverse @ difference
    covariance = coefficient_covariance(difference - columns @ values, inverse, other.pick, columns.shape[1])
    k = len(TOLERANCE[family])
    usual = np.diag(other.tolerance(family) ** 2)
    gain = np.linalg.solve(covariance[:k, :k] + usual, covariance[:k, -1])
    variance = covariance[-1, -1] - gain @ covariance[:k, -1]
    return float(values[-1] - gain @ values[:k]), float(np.sqrt(max(variance, 0.0)))


def _joint(rows: Sequence[tuple[float, float]]) -> Leak:
    """One share from what channels say, each with its sd, and the sd of that of any further channel.

    Channels differ by what these differ by and by what the table says. One channel alone says nothing: an
    LVDT that does not stand where the rig file says looks like crosstalk.
    """
    if len(rows) < 2:
        return UNKNOWN_LEAK
    shares, errors = np.array(rows).T
    group = random_effects_mean(shares.tolist(), errors.tolist())
    between = group.scatter**2 + (LEAKS_DIFFER * group.mean) ** 2
    weights = 1.0 / (errors**2 + between)
    known = float(weights.sum()) + CROSSTALK**-2
    return Leak(float(shares @ weights) / known, min(math.sqrt(1.0 / known + between), CROSSTALK))


def smoothed(run: GapRun, chosen: Sequence[int], late_s: float = 0.0) -> FloatArray:
    """Averages of accelerometers over 40 ms on the grid, (k, m), m/s², taken sooner by what they are late.

    At the full rate, so that local ringing above 100 Hz does not fold into the grid's own band, and with a
    window of finite length: each place rings in its own way, and none of it may leave the mask.
    """
    window = np.hanning(round(_SMOOTH_S * run.rate_hz))
    window /= window.sum()
    early = round(late_s * run.rate_hz)

    def one(index: int) -> FloatArray:
        return coarse(oaconvolve(sooner(zeroed(run, index), early), window, "same"), run.rate_hz)

    return np.array([run.cache.constant(("smoothed", i, early), partial(one, i)) for i in chosen])

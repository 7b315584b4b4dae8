"""Channels that disagree with their own family: which, and a lone one in what (gain, lag, curvature, drift).

Each channel is predicted from the others of its family by geometry alone, so that whatever the wall or
the whole family does cancels. What is left is regressed on a few shapes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.signal import oaconvolve

from daq_app.config.rig import Family
from daq_app.gap.core.features import FloatArray, independent_fraction
from daq_app.gap.rocking_model.motion_grid import GRID_HZ, Grid, coarse
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.rotation import WireInverse, wall_rotation, zeroed
from daq_app.gap.rocking_model.sensor_blocks import Block

_SHAPES = ("gain", "lag", "curvature", "drift")
SHAPES: dict[Family, tuple[str, ...]] = {
    "lvdt": _SHAPES,
    "wire": (*_SHAPES, "side"),
    "accelerometer": _SHAPES,
}
"""Of wires also half the difference in gain between the two sides: the wall lifts on one side only, and a
wire whose anchor is not as high as the rig file says slopes and sees it. A joint opens at one face at a time:
LVDTs have no other side."""
_UNITS: dict[Family, tuple[str, ...]] = {
    "lvdt": ("1", "s", "1/m", "m/s"),
    "wire": ("1", "s", "1/m", "m/s", "1"),
    "accelerometer": ("1", "s", "s²/m", "m/s³"),
}
TOLERANCE: dict[Family, tuple[float, ...]] = {
    "lvdt": (3.2e-3, 1e-4, 0.06, 4e-6),
    "wire": (3.2e-3, 3e-4, 0.02, 1.2e-5, 5e-4),
    "accelerometer": (8e-3, 2e-3, 2e-3, 1.5e-3),
}
"""What healthy channels differ by: calibration, and how well the others predict them. Accelerometers also
by the place's own ringing, which a hop of the wall carries beyond the mask. An LVDT's lag is as good as what
its family may be late by: a twelfth of it is in the time across every impact, to one side up and to the other
down, and those times repeat to some hundredths of a millisecond. The side of wires is an anchor known to
5 mm."""
CALIBRATION = 3e-3
"""Relative tolerance of one channel's calibration."""
_SOUND = 0.5
"""Standard deviation of what a sound channel is off by, in those tolerances."""
SUSPECT: dict[Family, float] = {"lvdt": 4.0, "wire": 2.0, "accelerometer": 3.0}
"""Tolerances by which a channel must be off to be looked at on its own. Each wire is told from few others, so
its tolerance is wide already."""
CROWDED: tuple[Family, ...] = ("lvdt", "accelerometer")
"""Families in which several channels may be wrong and the others still say so."""
STRUCTURE = 0.5
"""Excess of the logarithm of what remains over noise from which a channel is suspect for it alone."""
STRUCTURE_SD = 0.2
RINGING: tuple[Family, ...] = ("accelerometer",)
"""Families whose channels differ in how they ring: what remains of one says nothing."""
_SMOOTH_S = 0.04
"""Window over which accelerations are averaged: with 30 ms of ringing it stays within the mask of 50 ms."""
SCREENED = 3
"""Runs that are looked at before all are."""


@dataclass(frozen=True, slots=True)
class Others:
    """A channel beside what the others of its family make of it, on the grid; both (m,), SI."""

    measured: FloatArray
    expected: FloatArray
    pick: NDArray[np.bool_]
    spread: float
    """How many times one channel's calibration error the relative error of the prediction is."""
    rough: float = 0.0
    """Rms of what the steps of these readings make of the difference; 0 where they have none."""
    repeats: int = 1
    """Half-cycles, in each of which the same steps come back."""
    sided: bool = False
    """Whether its side is among the shapes."""


@dataclass(frozen=True, slots=True)
class Deviation:
    """Coefficients of one channel in one run (`SHAPES`), with covariance, and what remains over noise."""

    values: FloatArray
    covariance: FloatArray
    projection: FloatArray
    design: FloatArray
    """Orthonormal basis of the shapes at the samples used."""
    remains: float
    """ln of the rms that the shapes leave, over the rms at rest."""
    noise: float


@dataclass(frozen=True, slots=True)
class _Family:
    """Signals of a family on the grid with their geometry: signals ≈ design @ motion, row by row."""

    ids: tuple[str, ...]
    signals: FloatArray
    design: FloatArray
    pick: NDArray[np.bool_]
    step: float = 0.0
    repeats: int = 1
    sided: bool = False


@dataclass(frozen=True, slots=True)
class Suspects:
    """Channels that disagree with their family."""

    single: dict[Family, str]
    """The one channel without which all others of its family agree."""
    several: dict[Family, tuple[str, ...]]
    """Channels of one family, two or more, without which the others agree."""

    @property
    def ids(self) -> tuple[str, ...]:
        """All of them."""
        return (*self.single.values(), *(name for names in self.several.values() for name in names))


def suspects(
    runs: Sequence[GapRun], grids: Sequence[Grid], steps: Mapping[str, float] = MappingProxyType({})
) -> Suspects:
    """The channels of each family that disagree with all others, where the others agree.

    `steps` are those of the families, m, whose readings go in steps.
    """
    single: dict[Family, str] = {}
    several: dict[Family, tuple[str, ...]] = {}
    for family in TOLERANCE:
        step = steps.get(family, 0.0)
        data = [_family(run, grid, family, step) for run, grid in zip(runs, grids, strict=True)]
        usable = [d for d in data if d is not None]
        if len(usable) < len(data) or not usable:
            continue
        some = usable[:: max(len(usable) // SCREENED, 1)][:SCREENED]
        sizes = _sizes(some, family, ())
        order = [n for n in sorted(sizes, key=lambda n: -sizes[n]) if sizes[n] > 0.5 * SUSPECT[family]]
        if not order:
            continue
        together = _together(usable, family)
        alone = None if together else _alone(usable, family, order[:3])
        if together:
            several[family] = together
        elif alone is not None:
            single[family] = alone
    return Suspects(single, several)


def _alone(usable: Sequence[_Family], family: Family, order: Sequence[str]) -> str | None:
    """The one channel without which the others agree, if there is one."""
    bar = SUSPECT[family]
    # A bad channel spoils the prediction of the others: right is one without which all agree. Of few
    # sensors at few heights two may do, of which one asks for a base that moves with the wall.
    agreed: list[tuple[float, float, str]] = []
    for name in order:
        rest = _sizes(usable, family, (name,))
        own = rest.pop(name)
        agree = max(bar, 0.4 * own)
        if own > bar and max(rest.values()) < agree:
            doubt = max(rest.values()) if family == "lvdt" else _base_moves(usable, name)
            agreed.append((doubt, agree, name))
    if not agreed:
        return None
    _, agree, name = min(agreed)
    return None if _all_bent(usable, family, name, agree) else name


def _all_bent(usable: Sequence[_Family], family: Family, name: str, agree: float) -> bool:
    """Whether one curvature of all channels explains their disagreement, and better than one faulty channel.

    It is the one fault of a whole family that does not cancel between its channels; of few channels one that
    is bent looks much like it, but leaves some in the others.
    """
    straight = [_straightened(d) for d in usable]
    if max(_sizes(straight, family, ()).values()) > agree:
        return False
    left = _sizes(usable, family, (name,), "curvature")
    del left[name]
    return max(_sizes(straight, family, (), "curvature").values()) < max(left.values())


def _together(usable: Sequence[_Family], family: Family) -> tuple[str, ...]:
    """Two or more channels, of many at most a quarter, without which the others agree.

    The worst is taken out, then the worst of the others, and so on. It needs a family in which many
    predict each one: five wires at four heights do not say which two of them are wrong.
    """
    if family not in CROWDED:
        return ()
    bar, found = SUSPECT[family], list[str]()
    for _ in range(max(len(usable[0].ids) // 4, 2) + 1):
        sizes = _sizes(usable, family, tuple(found))
        rest = {name: size for name, size in sizes.items() if name not in found}
        worst = max(rest, key=lambda name: rest[name])
        if rest[worst] <= bar:
            clear = all(0.4 * sizes[name] > min(rest[worst], bar) for name in found)
            return tuple(sorted(found)) if len(found) > 1 and clear else ()
        found.append(worst)
    return ()


def _base_moves(data: Sequence[_Family], without: str) -> float:
    """Rms that the channels but one make of the base's movement: a wall stands still there, or nearly."""
    total = 0.0
    for entry in data:
        others = [i for i, other in enumerate(entry.ids) if other != without]
        moved = np.linalg.pinv(entry.design[others])[0] @ entry.signals[others]
        total += float(np.mean(moved[entry.pick] ** 2))
    return float(np.sqrt(total))


def _sizes(
    data: Sequence[_Family], family: Family, without: tuple[str, ...], shape: str = ""
) -> dict[str, float]:
    """How far off each channel is, in tolerances: the middle of all runs; in one shape, or in any."""
    rows: dict[str, list[float]] = {}
    for entry in data:
        beside = {name: _beside(entry, name, without) for name in entry.ids}
        table = {name: deviation(other) for name, other in beside.items()}
        usual = float(np.median([found.remains for found in table.values()]))
        for name, found in table.items():
            tolerance = np.array(TOLERANCE[family]) * beside[name].spread
            sd = np.hypot(tolerance, np.sqrt(np.diag(found.covariance)))
            sizes = np.abs(found.values / sd)
            if shape:
                rows.setdefault(name, []).append(float(sizes[SHAPES[family].index(shape)]))
                continue
            size = float(sizes.max())
            if family in RINGING:
                usual = found.remains
            rows.setdefault(name, []).append(max(size, SUSPECT[family] * (found.remains - usual) / STRUCTURE))
    return {name: float(np.median(values)) for name, values in rows.items()}


def _straightened(data: _Family) -> _Family:
    """The family less the error κ u² that, with one κ for all channels, explains most of its disagreement."""
    apart = np.eye(len(data.ids)) - data.design @ np.linalg.pinv(data.design)
    # A zero that is off or drifts is no curvature, though u² would take up most of it on one face; nor are
    # unequal gains, of which a wall that is let go from one side leaves u² some.
    moved = data.signals.mean(axis=0)[data.pick]
    still = np.vander(np.linspace(-1.0, 1.0, data.pick.size)[data.pick], 2)
    steady = np.linalg.qr(np.column_stack([still, moved / max(float(np.abs(moved).max()), 1e-300)]))[0]
    seen, bent = (
        rows - (rows @ steady) @ steady.T
        for rows in ((apart @ data.signals)[:, data.pick], (apart @ data.signals**2)[:, data.pick])
    )
    kappa = float(np.sum(bent * seen)) / max(float(np.sum(bent**2)), 1e-300)
    return replace(data, signals=data.signals - kappa * data.signals**2)


def channel_block(run: GapRun, grid: Grid, family: Family, name: str, step: float = 0.0) -> Block | None:
    """The coefficients of one channel as a block of features; `step` as for `suspects`."""
    data = _family(run, grid, family, step, include=(name,))
    if data is None or name not in data.ids:
        return None
    beside = _beside(data, name, (name,))
    found = deviation(beside)
    usual = float(np.median([deviation(_beside(data, n, (name,))).remains for n in data.ids if n != name]))
    k = len(SHAPES[family])
    covariance = np.zeros((k + 1, k + 1))
    covariance[:k, :k] = found.covariance
    covariance[k, k] = STRUCTURE_SD**2
    remains = 0.0 if family in RINGING else max(found.remains - usual, 0.0)
    return Block(
        name,
        (*SHAPES[family], "what remains"),
        (*_UNITS[family], "1"),
        np.append(found.values, remains),
        covariance,
        found.projection,
        beside.pick,
        kind="channel",
        expected=beside.expected,
        design=found.design,
        noise=found.noise * float(np.exp(max(usual, 0.0))),
        wire=_wire(run, name) if family == "wire" else None,
        tags={name: family},
        levers=(CALIBRATION * beside.spread, *(_SOUND * beside.spread * t for t in TOLERANCE[family][1:])),
    )


def _wire(run: GapRun, name: str) -> WireInverse:
    sensor = next(sensor for sensor in run.sensors if sensor.id == name)
    return WireInverse.of(sensor, run.survey.half_base_m)


def deviation(beside: Others) -> Deviation:
    """Regress what a channel shows beyond the others' prediction on the shapes."""
    e = beside.expected
    columns = np.column_stack(
        [
            e,
            -np.gradient(e, 1.0 / GRID_HZ),
            e**2,
            np.arange(e.size) / GRID_HZ,
            *([np.abs(e)] if beside.sided else []),
            np.ones_like(e),
        ]
    )[beside.pick]
    scale = np.sqrt(np.mean(columns**2, axis=0)) + 1e-300
    inverse = np.linalg.pinv(columns / scale, rcond=1e-9) / scale[:, None]
    difference = (beside.measured - e)[beside.pick]
    left = difference - columns @ (inverse @ difference)
    variance = left_over = float(left @ left) / max(left.size - columns.shape[1], 1)
    fraction = max(independent_fraction(left), 0.01)
    rest = (beside.measured - e)[-round(0.4 * GRID_HZ) :]
    noise = float(np.std(rest - np.linspace(rest[:8].mean(), rest[-8:].mean(), rest.size))) + 1e-12
    # At rest a reading in steps shows none of them, and in motion the same ones in every half-cycle.
    noise = float(np.hypot(noise, beside.rough))
    if beside.rough > 0.0:
        variance *= max(beside.repeats, 1)
    kept = slice(0, columns.shape[1] - 1)
    covariance = variance / fraction * (inverse @ inverse.T)[kept, kept]
    return Deviation(
        (inverse @ difference)[kept],
        covariance,
        inverse[kept],
        np.linalg.qr(columns / scale)[0],
        0.5 * float(np.log(left_over / noise**2)),
        noise,
    )


def _beside(data: _Family, name: str, without: tuple[str, ...]) -> Others:
    place = data.ids.index(name)
    others = [i for i, other in enumerate(data.ids) if other != name and other not in without]
    weights = data.design[place] @ np.linalg.pinv(data.design[others])
    expected = weights @ data.signals[others]
    # A channel far from the others is predicted by a difference of them: their errors grow.
    sizes = np.sqrt(np.mean(data.signals[others] ** 2, axis=1))
    own = float(np.sqrt(np.mean(expected**2))) + 1e-300
    spread = float(np.sqrt(1.0 + np.sum((weights * sizes / own) ** 2)))
    rough = data.step / np.sqrt(12.0) * float(np.sqrt(1.0 + np.sum(weights**2)))
    return Others(data.signals[place], expected, data.pick, spread, rough, data.repeats, data.sided)


def _family(
    run: GapRun, grid: Grid, family: Family, step: float = 0.0, include: tuple[str, ...] = ()
) -> _Family | None:
    whole = run.including(include)
    moving = (grid.time_s > -0.5) & (grid.time_s < grid.rest_s + 0.2)
    found: _Family | None = None
    match family:
        case "lvdt":
            found = _lvdts(whole, moving & grid.valid)
        case "wire":
            found = _wires(whole, moving)
        case "accelerometer":
            found = _accelerometers(whole, moving & ~grid.near_impact)
    return found and replace(found, step=step, repeats=grid.impact_s.size, sided="side" in SHAPES[family])


def _lvdts(run: GapRun, pick: NDArray[np.bool_]) -> _Family | None:
    chosen = [i for i in run.indices("lvdt") if np.all(np.isfinite(run.channels[i]))]
    if len(chosen) < 8:
        return None
    place = np.array([run.sensors[i].position_m for i in chosen])
    # A face's calibrations that differ along its length look like a twist, of that face alone.
    twist = -place[:, :1] * place[:, 1:2] * np.column_stack([place[:, 0] < 0, place[:, 0] > 0])
    design = np.column_stack([np.ones(len(chosen)), -place[:, 0], twist])
    signals = np.array([coarse(zeroed(run, i), run.rate_hz) for i in chosen])
    return _Family(tuple(run.sensors[i].id for i in chosen), signals, design, pick)


def _wires(run: GapRun, pick: NDArray[np.bool_]) -> _Family | None:
    rows, heights, names = wall_rotation(run)
    if len(names) < 4:
        return None
    signals = np.array([z * coarse(row, run.rate_hz) for z, row in zip(heights, rows, strict=True)])
    return _Family(names, signals, np.column_stack([np.ones(len(names)), heights]), pick)


def _accelerometers(run: GapRun, pick: NDArray[np.bool_]) -> _Family | None:
    chosen = [
        i
        for i in run.indices("accelerometer", "x")
        if np.all(np.isfinite(run.channels[i])) and not run.sensors[i].ac_coupled
    ]
    if len(chosen) < 4:
        return None
    # At the full rate, so that local ringing above 100 Hz does not fold into the grid's own band, and with
    # a window of finite length: each place rings in its own way, and none of it may leave the mask.
    window = np.hanning(round(_SMOOTH_S * run.rate_hz))
    window /= window.sum()
    signals = np.array([coarse(oaconvolve(zeroed(run, i), window, "same"), run.rate_hz) for i in chosen])
    heights = np.array([run.sensors[i].position_m[2] for i in chosen])
    names = tuple(run.sensors[i].id for i in chosen)
    return _Family(names, signals, np.column_stack([np.ones(len(chosen)), heights]), pick)

"""Channels that disagree with their own family: which, and a lone one as a block of features of its own.

Each channel is predicted from the others of its family by geometry alone, so that whatever the wall or
the whole family does cancels.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from daq_app.config.rig import Family
from daq_app.gap.core.features import FloatArray, robust_sd
from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.features.channel_shapes import (
    RINGING,
    SHAPES,
    TOLERANCE,
    Others,
    block_of,
    deviation,
    usual_remains,
)
from daq_app.gap.rocking_model.inspection.channel_families import (
    ChannelFamily,
    beside,
    channel_family,
    leak_into_wires,
)
from daq_app.gap.rocking_model.motion.crosstalk import UNKNOWN_LEAK, Leak
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ, Wire, finer_step, zeroed
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.inspection import AS_SINGLE, OTHERS_AGREE, REMAINS, SUSPECT

CROWDED: tuple[Family, ...] = ("lvdt", "accelerometer")
"""Families in which several channels may be wrong and the others still say so."""
TELLING: tuple[Family, ...] = ("lvdt",)
"""Families of so many channels that they themselves tell how much sound ones differ."""
_POWERS = (1, 1, 2, 0, 1)
"""Power of its reading that each of a wire's shapes goes with. The wall's rotation θ adds height × f(θ) to
every reading, and its base the same to all."""
_STILL = (3.2e-3, 3e-4, 0.02, 1.2e-5, 5e-4)
"""How still a base stands, in those shapes, in m and at a reading of one: as far as a wire a metre up is
right, and a pivot 40 mm further in makes 0.02 of the square, whatever wires do."""
LOOKED_AT = 6
"""The channels that are off most, of which any may be the wrong one: at the end of a row it moves what its
neighbours are predicted by more than they leave of its own fault."""
_OF_MEDIAN = math.pi / 2.0
"""Variance of the median of many values over that of their mean; that of two is their mean."""
SCREENED = 3
"""Runs that are looked at before all are."""


@dataclass(frozen=True, slots=True)
class Lone:
    """A channel that is examined on its own."""

    family: Family
    leak: Leak = UNKNOWN_LEAK
    """What is known of the crosstalk in it."""
    twisted: bool = False
    """Whether the others of its family agree only beside a wall that turns about the vertical."""


@dataclass(frozen=True, slots=True)
class OutlierChannels:
    """Channels that disagree with their family: those of each family without which the others agree."""

    channels: dict[Family, tuple[str, ...]]
    leak: Leak
    """What the other families say of the crosstalk in the wires."""
    twisted: bool = False
    """Whether the wires were compared beside a wall that turns about the vertical."""

    @property
    def ids(self) -> tuple[str, ...]:
        """All of them."""
        return tuple(name for names in self.channels.values() for name in names)

    @property
    def single(self) -> dict[str, Lone]:
        """Those whose faults effects may explain one by one."""
        few = {family: names for family, names in self.channels.items() if len(names) <= AS_SINGLE}
        wire = Lone("wire", self.leak, self.twisted)
        return {
            name: wire if family == "wire" else Lone(family)
            for family, names in few.items()
            for name in names
        }

    @property
    def several(self) -> dict[Family, tuple[str, ...]]:
        """Those of families in which more disagree than can be examined one by one."""
        return {family: names for family, names in self.channels.items() if len(names) > AS_SINGLE}

    def plus(self, family: Family, name: str | None) -> OutlierChannels:
        """These with one more of a family."""
        if name is None:
            return self
        known = {*self.channels.get(family, ()), name}
        return replace(self, channels={**self.channels, family: tuple(sorted(known))})


def find_outlier_channels(
    runs: Sequence[GapRun], grids: Sequence[Grid], steps: Mapping[str, float] = MappingProxyType({})
) -> OutlierChannels:
    """The channels of each family that disagree with all others, where the others agree.

    `steps` are those of the families, m, whose readings go in steps.
    """
    families: dict[Family, list[ChannelFamily]] = {}
    for family in TOLERANCE:
        step = steps.get(family, 0.0)
        data = [channel_family(run, grid, family, step) for run, grid in zip(runs, grids, strict=True)]
        present = [d for d in data if d is not None]
        if present and len(present) == len(data):
            families[family] = present
    leak = leak_into_wires({family: _some(data) for family, data in families.items()}, runs[0])
    channels: dict[Family, tuple[str, ...]] = {}
    twisted = False
    for family, of_runs in families.items():
        usable = [entry.knowing(leak) for entry in of_runs] if family == "wire" else of_runs
        names = _disagreeing(usable, family)
        straight = [s for s in (entry.untwisted() for entry in usable) if s is not None]
        if not names and len(straight) == len(usable):
            # No wire of a wall that turns about the vertical agrees with the others.
            names = _disagreeing(straight, family)
            twisted = bool(names)
        if names:
            channels[family] = names
    return OutlierChannels(channels, leak, twisted)


def _disagreeing(usable: Sequence[ChannelFamily], family: Family) -> tuple[str, ...]:
    """The channels of a family without which the others agree; none where there are no such."""
    sizes = _sizes(_some(usable), family, ())
    order = [n for n in sorted(sizes, key=lambda n: -sizes[n]) if sizes[n] > 0.5 * SUSPECT[family]]
    if not order:
        return ()
    if several := _outlier_set(usable, family):
        return several
    single = _single_outlier(usable, family, order[:LOOKED_AT])
    return () if single is None else (single,)


def _some(of_runs: Sequence[ChannelFamily]) -> Sequence[ChannelFamily]:
    """Those of the runs that are looked at before all are."""
    return of_runs[:: max(len(of_runs) // SCREENED, 1)][:SCREENED]


def _single_outlier(usable: Sequence[ChannelFamily], family: Family, order: Sequence[str]) -> str | None:
    """The one channel without which the others agree, if there is one."""
    bar = SUSPECT[family]
    # A bad channel spoils the prediction of the others: right is one without which all agree. Where
    # few sensors stand at few heights two may do, of which one asks for a base that moves with the wall.
    agreed: list[tuple[float, float, str]] = []
    for name in order:
        rest = _sizes(usable, family, (name,))
        size = rest.pop(name)
        agree = max(bar, OTHERS_AGREE * size)
        if size > bar and max(rest.values()) < agree:
            doubt = _wires_doubt(usable, name) if family == "wire" else max(rest.values())
            agreed.append((doubt, agree, name))
    if not agreed:
        return None
    _, agree, name = min(agreed)
    return None if _all_bent(usable, family, name, agree) else name


def _all_bent(usable: Sequence[ChannelFamily], family: Family, name: str, agree: float) -> bool:
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


def _outlier_set(usable: Sequence[ChannelFamily], family: Family) -> tuple[str, ...]:
    """Two or more channels, of many at most a quarter, without which the others agree.

    The worst is taken out, then the worst of the others, and so on. It needs a family in which many
    predict each one: five wires at four heights do not say which two of them are wrong.
    """
    if family not in CROWDED:
        return ()
    bar, outliers = SUSPECT[family], list[str]()
    for _ in range(max(len(usable[0].ids) // 4, 2) + 1):
        sizes = _sizes(usable, family, tuple(outliers))
        rest = {name: size for name, size in sizes.items() if name not in outliers}
        worst = max(rest, key=lambda name: rest[name])
        if rest[worst] <= bar:
            clear = all(OTHERS_AGREE * sizes[name] > min(rest[worst], bar) for name in outliers)
            return tuple(sorted(outliers)) if len(outliers) > 1 and clear else ()
        outliers.append(worst)
    return ()


def _wires_doubt(data: Sequence[ChannelFamily], without: str) -> float:
    """How far all wires but one are from what sound ones show of a wall whose base stands still: χ².

    The wall's rotation is free in every shape, and so is the base as far as one that stands still goes. Of
    four wires at three heights a base that moves takes up most of what a fifth one is off by, so neither what
    they disagree in nor how little the base moves tells alone which one is wrong.
    """
    return float(np.median([_misfit(entry, without) for entry in data]))


def _misfit(data: ChannelFamily, without: str) -> float:
    """The same of one run."""
    heights = data.design[:, 1]
    mean = heights @ data.signals / (heights @ heights)
    powers, tolerance = np.array(_POWERS), np.array(TOLERANCE["wire"])
    rows: list[FloatArray] = []
    values: list[FloatArray] = []
    for i, name in enumerate(data.ids):
        if name == without:
            continue
        misfit = deviation(Others(data.signals[i], heights[i] * mean, data.pick, 1.0, further=data.further))
        # In units of the errors of this wire, which differ from shape to shape and hang together.
        whiten = np.linalg.inv(np.linalg.cholesky(np.diag(tolerance**2) + misfit.covariance))
        rows.append(
            whiten @ np.hstack([np.diag(heights[i] ** (1.0 - powers)), np.diag(heights[i] ** -powers)])
        )
        values.append(whiten @ misfit.values)
    still = np.hstack([np.zeros((powers.size, powers.size)), np.diag(1.0 / np.array(_STILL))])
    design = np.vstack([*rows, still])
    seen = np.concatenate([*values, np.zeros(powers.size)])
    left = seen - design @ np.linalg.lstsq(design, seen, rcond=None)[0]
    return float(left @ left)


def _sizes(
    data: Sequence[ChannelFamily], family: Family, without: tuple[str, ...], shape: str = ""
) -> dict[str, float]:
    """How far off each channel is, in tolerances: in the middle of all runs; in one shape, or in any."""
    off, noise = defaultdict[str, list[FloatArray]](list), defaultdict[str, list[FloatArray]](list)
    left = defaultdict[str, list[float]](list)
    for entry in data:
        rows_beside = {name: beside(entry, name, without) for name in entry.ids}
        table = {name: deviation(other) for name, other in rows_beside.items()}
        usual = usual_remains([misfit.remains for misfit in table.values()])
        for name, misfit in table.items():
            tolerance = rows_beside[name].tolerance(family)
            off[name].append(misfit.values / tolerance)
            noise[name].append(misfit.covariance / np.outer(tolerance, tolerance))
            left[name].append(0.0 if family in RINGING else misfit.remains - usual)
    middle = {name: np.median(each, axis=0) for name, each in off.items()}
    share = (_OF_MEDIAN if len(data) > 2 else 1.0) / len(data)
    known = {name: share * np.mean(each, axis=0) for name, each in noise.items()}
    wider = _wider(middle, known) if family in TELLING else np.ones(len(SHAPES[family]))
    sizes: dict[str, float] = {}
    for name, values in middle.items():
        errors = _errors(values, known[name] + np.diag(wider**2))
        remains = SUSPECT[family] * float(np.median(left[name])) / REMAINS
        sizes[name] = (
            float(errors[SHAPES[family].index(shape)]) if shape else max(float(errors.max()), remains)
        )
    return sizes


def _wider(off: Mapping[str, FloatArray], noise: Mapping[str, FloatArray]) -> FloatArray:
    """How many times the tolerance of each shape the channels of a family differ by, (k,); 1 at least.

    Some laboratories have LVDTs that bend more than most, and drift as little as any. `off` (k,) and `noise`,
    its covariance, are in tolerances.
    """
    seen = np.array([robust_sd(shape) for shape in np.array(list(off.values())).T])
    usual = np.median([np.diag(covariance) for covariance in noise.values()], axis=0)
    return np.asarray(np.sqrt(np.maximum(seen**2 - usual, 1.0)))


def _errors(values: FloatArray, covariance: FloatArray) -> FloatArray:
    """Each coefficient in its own errors, (k,): alone, or beside the others where these say more of it.

    What leaks in from the channel that is scanned before may be of any size and has one shape. It says as
    little of the gain as of the side alone, and much of the two together.
    """
    precision = np.linalg.inv(covariance)
    alone = values / np.sqrt(np.diag(covariance))
    beside_others = precision @ values / np.sqrt(np.diag(precision))
    return np.asarray(np.maximum(np.abs(alone), np.abs(beside_others)))


def _straightened(data: ChannelFamily) -> ChannelFamily:
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


def channel_block(run: GapRun, grid: Grid, name: str, lone: Lone, step: float = 0.0) -> Block | None:
    """The coefficients of one channel as a block of features; `step` as for `find_outlier_channels`."""
    family = lone.family
    data = channel_family(run, grid, family, step, include=(name,))
    if data is None or name not in data.ids:
        return None
    data = data.knowing(lone.leak)
    if lone.twisted:
        data = data.untwisted() or data
    others = beside(data, name, (name,))
    sound = [(row, deviation(row)) for row in (beside(data, n, (name,)) for n in data.ids if n != name)]
    wire = Wire(run.sensors[run.place(name)], run.survey.half_base_m) if family == "wire" else None
    return block_of(name, family, others, sound, wire, _finer(run, data, others))


def _finer(run: GapRun, data: ChannelFamily, others: Others) -> tuple[FloatArray, float] | None:
    """The prediction of a channel at a millisecond's resolution, and its rate in Hz; None where no shape of
    its family needs it."""
    if "rounding" not in others.further or others.weights is None:
        return None
    step = finer_step(run.rate_hz)
    places = [run.place(name) for name in data.ids]
    whole = sum(
        weight * zeroed(run, i) for weight, i in zip(others.weights, places, strict=True) if weight != 0.0
    )
    kept = len(others.expected) * round(run.rate_hz / GRID_HZ)
    return np.asarray(whole)[:kept].reshape(-1, step).mean(axis=1), run.rate_hz / step

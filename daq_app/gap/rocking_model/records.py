"""Runs as the rocking model takes them: engineering units in memory, from a run file or from elsewhere."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from daq_app.config.rig import Channel, Family, Rig, Specimen
from daq_app.gap.core import CannotDiagnose
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.run_cache import RunCache
from daq_app.rocking.families.base.slip import BaseSlip
from daq_app.runfile import open_run

GRAVITY_M_S2 = 9.81
"""As in the weights of Table 3.1, whose masses are weight / 9.81."""
Vector3 = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Sensor:
    """What the diagnosis needs to know of a channel."""

    id: str
    family: Family
    position_m: Vector3
    anchor_m: Vector3 | None = None
    axis: str = "x"
    range_si: tuple[float, float] = (-math.inf, math.inf)
    noise_si: float = 0.0
    time_constant_s: float = 0.0
    ac_coupled: bool = False
    si_per_reading: float = math.nan
    """Signed; NaN where it is not known."""

    @classmethod
    def from_channel(cls, channel: Channel) -> Sensor:
        return cls(
            channel.id,
            channel.family,
            channel.position_m,
            channel.anchor_m,
            channel.axis,
            (channel.range_si[0], channel.range_si[1]),
            channel.noise_si,
            channel.time_constant_s,
            channel.measurement == "iepe",
            channel.polarity / channel.sensitivity_reading_per_si,
        )


@dataclass(frozen=True, slots=True)
class Survey:
    """The specimen as it was surveyed: nominal values and how far the truth may lie from them."""

    name: str
    alpha_rad: float
    p_rad_s: float
    half_base_m: float
    height_m: float
    alpha_tolerance: float = 0.03
    """Relative prior sd of α (the height of the centre of mass is hard to survey)."""
    p_tolerance: float = 0.02
    half_base_tolerance_m: float = 3e-3
    mount_tolerance_m: float = 5e-3
    """Prior sd of the height of the LVDTs' points: a tape tells it, and a bracket is no finer."""

    @classmethod
    def from_specimen(cls, specimen: Specimen) -> Survey:
        p = math.sqrt(specimen.weight_n * specimen.r0_m / specimen.rotational_inertia_kg_m2)
        return cls(specimen.name, specimen.alpha0_rad, p, specimen.base_width_m / 2, specimen.height_m)

    @property
    def r0_m(self) -> float:
        """Distance of the centre of mass from the edge, m."""
        return self.half_base_m / math.sin(self.alpha_rad)

    @property
    def r_max(self) -> float:
        """1 − 3/2 sin²α of a rectangular block (Eqn 1.2)."""
        return 1.0 - 1.5 * math.sin(self.alpha_rad) ** 2


@dataclass(frozen=True, slots=True)
class GapRun:
    """One recorded test in engineering units.

    `channels`: shape (c, n), SI, in the order of `sensors`; NaN in gaps. `time_offset_s`: shape
    (c,), sample time of a channel after the sample clock.
    """

    name: str
    level: str
    rate_hz: float
    sensors: tuple[Sensor, ...]
    channels: FloatArray
    survey: Survey
    time_offset_s: FloatArray = field(default_factory=lambda: np.zeros(0))
    impacts_before: float = 0.0
    start_utc_ns: int = 0
    """Wall clock of the first sample, which orders the campaign; 0 where it is not known."""
    excluded: tuple[str, ...] = ()
    """Channels that are examined on their own and not used with their family."""
    scanned_before: tuple[int, ...] = ()
    """Place of the channel that is scanned before each one, −1 for the first; empty where that is the one
    before it in the row, as it is unless plugs were exchanged."""
    slip: BaseSlip | None = None
    """The slip of the base that wires and accelerometers are without; None where none is known."""
    cache: RunCache = field(default_factory=RunCache, init=False, repr=False, compare=False)
    """Channels of this very run on the grid of the regressions, and rotations of its wires.

    A run that is made from this one by `replace` begins without any, so that none is ever out of date.
    """

    def indices(self, family: Family, axis: str | None = None) -> list[int]:
        """Places of the channels of a family (and axis), without the excluded ones."""
        return [
            i
            for i, sensor in enumerate(self.sensors)
            if sensor.family == family
            and (axis is None or sensor.axis == axis)
            and sensor.id not in self.excluded
        ]

    def place(self, name: str) -> int:
        """Place of the channel of that id."""
        return next(i for i, sensor in enumerate(self.sensors) if sensor.id == name)

    def before(self, place: int) -> int:
        """Place of the channel that is scanned before this one; −1 where there is none."""
        return self.scanned_before[place] if self.scanned_before else place - 1

    def steady_accelerometers(self, axis: str) -> list[int]:
        """Places of the accelerometers along an axis that read, and read down to standstill."""
        return [
            i for i in self.indices("accelerometer", axis) if self.reads(i) and not self.sensors[i].ac_coupled
        ]

    def reads(self, place: int) -> bool:
        """Whether a channel has no gap."""
        return self.cache.constant(("reads", place), lambda: bool(np.isfinite(self.channels[place]).all()))

    def positions(self, places: Sequence[int]) -> FloatArray:
        """Where some of the sensors are, (k, 3), m."""
        return np.array([self.sensors[i].position_m for i in places], dtype=np.float64).reshape(-1, 3)

    def at_clock(self) -> GapRun:
        """The run with all channels at the instants of the sample clock."""
        if not self.time_offset_s.size or not np.any(self.time_offset_s):
            return self
        channels = np.empty(self.channels.shape)
        for i, row in enumerate(channels):
            row[:] = self.aligned(i)
        return replace(self, channels=channels, time_offset_s=np.zeros(0))

    def including(self, ids: Sequence[str]) -> GapRun:
        """The run with these channels back among their family."""
        if not set(ids) & set(self.excluded):
            return self
        return self._with_excluded(tuple(name for name in self.excluded if name not in ids))

    def excluding(self, ids: Iterable[str]) -> GapRun:
        """The run without these channels."""
        more = tuple(name for name in dict.fromkeys(ids) if name not in self.excluded)
        return self._with_excluded(self.excluded + more) if more else self

    def _with_excluded(self, ids: tuple[str, ...]) -> GapRun:
        changed = replace(self, excluded=ids)
        object.__setattr__(changed, "cache", self.cache)  # the channels are the same
        return changed

    def aligned(self, index: int) -> FloatArray:
        """A channel at the instants of the sample clock, shape (n,)."""
        values: FloatArray = self.channels[index]
        offset = self.time_offset_s[index] if self.time_offset_s.size else 0.0
        if offset == 0.0:
            return values
        # Straight lines between samples, a constant share of each; beyond the ends the end values.
        whole, share = divmod(-offset * self.rate_hz, 1.0)
        place = np.arange(values.size) + int(whole)
        before, after = values.take(place, mode="clip"), values.take(place + 1, mode="clip")
        return before + share * (after - before)


@dataclass(frozen=True, slots=True)
class Wiring:
    """What the check found, over all runs."""

    reversed_ids: tuple[str, ...] = ()
    exchanged: tuple[tuple[str, str], ...] = ()
    """(channel, channel whose sensor it shows)."""
    places: int = 0
    """Places by which the sensors are turned round among the terminals of their kind; 1 for any other
    exchange, 0 for none."""


def load_run(path: Path, rig: Rig | None = None) -> GapRun:
    """A run file of this product; `rig` replaces the rig file that the run carries.

    Raises `CannotDiagnose` where there is no rig or a channel is not in it, and the run file's own
    errors for a file that cannot be read.
    """
    with open_run(path) as run:
        rig = rig or run.rig
        if rig is None:
            raise CannotDiagnose(f"Run {path.name} carries no rig file.", "Name one with --rig.")
        beside = {channel.id for channel in rig.channels if channel.auxiliary}  # nothing predicts them
        ids = [name for name in run.channel_ids if name not in beside]
        missing = [name for name in ids if name not in rig.channel_ids]
        if missing:
            raise CannotDiagnose(
                f"Run {path.name} has channels that the rig file does not: {', '.join(missing[:5])}.",
                "Give the rig file with which it was recorded.",
            )
        channels = [rig.channel(name) for name in ids]
        name = run.header.test or path.stem
        return GapRun(
            name=name,
            level=level_of(name),
            rate_hz=float(run.rate_hz),
            sensors=tuple(Sensor.from_channel(channel) for channel in channels),
            channels=np.asarray(run.si(ids), dtype=float),
            survey=Survey.from_specimen(rig.specimen),
            time_offset_s=np.array([run.header.time_offset_s(name) for name in ids]),
            start_utc_ns=run.header.start_utc_ns,
        )


def level_of(test: str) -> str:
    """``FR1-L3-2`` → ``L3``; the whole name where there is no level in it."""
    parts = [part for part in test.split("-") if part[:1] == "L" and part[1:].isdigit()]
    return parts[0] if parts else test


def check_consistent(runs: Sequence[GapRun]) -> None:
    """Refuse runs that do not belong together."""
    if not runs:
        raise CannotDiagnose("There is no run to diagnose.", "Give at least one recorded run.")
    names = {run.survey.name for run in runs}
    if len(names) > 1:
        raise CannotDiagnose(
            f"The runs are of different specimens: {', '.join(sorted(names))}.",
            "Diagnose each specimen by itself.",
        )
    ids = {tuple(sensor.id for sensor in run.sensors) for run in runs}
    if len(ids) > 1:
        raise CannotDiagnose(
            "The runs were recorded with different channels.", "Diagnose each rig by itself."
        )

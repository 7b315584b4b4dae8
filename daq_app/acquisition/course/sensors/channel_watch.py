"""Looks at every block for channels that give numbers but no measurement: stuck, humming, leaping, contrary.

Only what no wall can do is told, so that a warning is never a false one: a sensor whose noise has vanished,
mains hum that drowns everything else while the wall stands still, a line whose voltage leaps within one
sample, a tiltmeter that leans the other way than the wires. Rails are `OverloadWatch`'s.
"""

from __future__ import annotations

from collections.abc import Iterable, Set
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Channel, Rig
from daq_app.config.scaling import Scaling
from drivers import Block

Floats = NDArray[np.float64]

_STUCK_S: Final = 0.3
"""Time without any change, s, after which a channel is stuck (assumed); noise moves it in milliseconds."""
_STEPS: Final = 2**16
_MAINS_HZ: Final = (50.0, 60.0)
_HUM_NOISE: Final = 3.0
"""Amplitude at the mains frequency, in the sensor's own noise, from which on it is hum."""
_HUM_SHARE: Final = 0.5
"""Share of a block's power at the mains frequency from which on it is hum and not the wall."""
_HUM_BLOCKS: Final = 3
"""Blocks in a row that must hum (assumed): a knock may look like it in one."""
_LEAP_SHARE: Final = 0.1
"""Share of the input range that is a leap within one sample. The fastest wall takes 0.1 s for it;
raising it lets smaller leaps of a loose plug pass."""
_LEAPING: Final = ("lvdt", "wire", "tiltmeter")
_TILTED: Final = 0.05
"""Share of α beyond which a tiltmeter and the wires must agree on the side."""
_CONTRARY_S: Final = 0.3
"""Time, s, for which a tiltmeter must lean the other way (assumed): it lags behind a wall that rocks."""


@dataclass(frozen=True, slots=True)
class Doubt:
    """A channel that is not to be trusted from `sample` on."""

    channel_id: str
    name: str
    """stuck, hum, leap or contrary"""
    sample: int
    text: str


class ChannelWatch:
    """Feed it every block; each doubt is told once (again after `forget`)."""

    def __init__(self, rig: Rig, rate_hz: float, ranges: dict[str, tuple[float, float]]) -> None:
        channels = rig.channels
        self._ids = rig.channel_ids
        self._rate_hz = rate_hz
        scaling = Scaling.of(channels)
        self._gain = scaling.gain[:, 0]
        self._zero = scaling.zero
        span = np.array([ranges[name][1] - ranges[name][0] for name in self._ids])
        self._noise = np.array([channel.noise_si for channel in channels]) / np.abs(self._gain)
        # A sensor quieter than its converter's step may well stand still.
        self._alive = self._noise >= 0.5 * span / _STEPS
        leaping = np.array([channel.family in _LEAPING for channel in channels])
        self._leap = np.where(leaping, _LEAP_SHARE * span, np.inf)
        self._wires = [row for row, channel in enumerate(channels) if channel.family == "wire"]
        self._tilts = [
            row
            for row, channel in enumerate(channels)
            if channel.family == "tiltmeter" and channel.axis == "x"
        ]
        self._tilted_rad = _TILTED * rig.specimen.alpha0_rad
        # Rotation per shortening of each wire, roughly: enough for the side the wall leans to.
        self._per_shortening = np.array([_per_shortening(channels[row]) for row in self._wires])
        self._still = np.zeros(len(self._ids))
        self._humming = np.zeros(len(self._ids), dtype=np.int64)
        self._contrary = np.zeros(len(self._ids))
        self._last: Floats | None = None
        self._last_sample = -1
        self._told: set[tuple[str, str]] = set()

    def forget(self) -> None:
        """Tell everything again that is still so; a new run begins."""
        self._told.clear()
        self._still[:] = 0
        self._humming[:] = 0
        self._contrary[:] = 0

    def check(self, block: Block, *, moving: bool, at_end: Set[str] = frozenset()) -> list[Doubt]:
        """What is doubted for the first time. `moving`: between release and rest.

        `at_end`: channels at the end of their travel: they stand still there without being stuck.
        """
        readings = block.readings
        doubts = [*self._stuck(block, at_end), *self._leaps(block)]
        if not moving:
            doubts += self._hum(block)
            doubts += self._contradictions(block)
        self._last, self._last_sample = readings[:, -1].copy(), block.first_sample + block.n_samples
        return doubts

    def _new(self, rows: Iterable[int], name: str, sample: int, text: str) -> list[Doubt]:
        doubts = []
        for row in rows:
            key = (self._ids[row], name)
            if key not in self._told:
                self._told.add(key)
                doubts.append(Doubt(self._ids[row], name, sample, text.format(id=self._ids[row])))
        return doubts

    def _stuck(self, block: Block, at_end: Set[str]) -> list[Doubt]:
        free = np.array([name not in at_end for name in self._ids])
        constant = self._alive & free & (np.ptp(block.readings, axis=1) == 0.0)
        if self._last is not None:
            constant &= block.readings[:, 0] == self._last
        self._still = np.where(constant, self._still + block.n_samples, 0)
        rows = np.flatnonzero(self._still > _STUCK_S * self._rate_hz)
        since = block.first_sample + block.n_samples - int(self._still.max(initial=0))
        return self._new(
            rows,
            "stuck",
            since,
            "{id} does not change any more, not even by noise: check its plug and supply",
        )

    def _leaps(self, block: Block) -> list[Doubt]:
        readings = block.readings
        step = np.abs(np.diff(readings, axis=1)).max(axis=1, initial=0.0)
        if self._last is not None and self._last_sample == block.first_sample:
            step = np.maximum(step, np.abs(readings[:, 0] - self._last))
        rows = np.flatnonzero(step > self._leap)
        return self._new(
            rows,
            "leap",
            block.first_sample,
            "{id} leapt within one sample, which no wall can do: a loose, open or exchanged wire. Check its "
            "plug and polarity; its readings from here on are not to be trusted",
        )

    def _hum(self, block: Block) -> list[Doubt]:
        n = block.n_samples
        if n < 0.05 * self._rate_hz:
            return []
        time = np.arange(n) / self._rate_hz
        centred = time - time.mean()
        rest = block.readings - block.readings.mean(axis=1, keepdims=True)
        rest = rest - np.outer(rest @ centred / (centred @ centred), centred)
        power = np.mean(rest**2, axis=1)
        waves = np.exp(-2j * np.pi * np.outer(_MAINS_HZ, time))
        amplitude = (2.0 / n * np.abs(rest @ waves.T)).max(axis=1)
        hums = (0.5 * amplitude**2 > _HUM_SHARE * power) & (amplitude > _HUM_NOISE * self._noise)
        self._humming = np.where(hums, self._humming + 1, 0)
        rows = np.flatnonzero(self._humming >= _HUM_BLOCKS)
        return self._new(
            rows,
            "hum",
            block.first_sample,
            "{id} hums with the mains, far above its noise: check its shield, ground and plug",
        )

    def _contradictions(self, block: Block) -> list[Doubt]:
        """A tiltmeter that leans the other way than the wires say."""
        if not self._wires or not self._tilts:
            return []
        mean = block.readings.mean(axis=1)
        si = (mean - self._zero[:, 0]) * self._gain
        rotation = float(np.median(si[self._wires] * self._per_shortening))
        if abs(rotation) < self._tilted_rad:
            self._contrary[:] = 0
            return []
        wrong = np.zeros(len(self._ids), dtype=np.bool_)
        wrong[self._tilts] = si[self._tilts] * np.sign(rotation) < -0.5 * self._tilted_rad
        self._contrary = np.where(wrong, self._contrary + block.n_samples, 0)
        rows = np.flatnonzero(self._contrary > _CONTRARY_S * self._rate_hz)
        return self._new(
            rows,
            "contrary",
            block.first_sample,
            "{id} leans the other way than the wires say: its polarity is wrong, or its wires are exchanged",
        )


def _per_shortening(wire: Channel) -> float:
    height_m = max(wire.position_m[2], 0.1)
    pulls_to_minus_x = wire.anchor_m is not None and wire.anchor_m[0] < wire.position_m[0]
    return (-1.0 if pulls_to_minus_x else 1.0) / height_m

"""Lone samples: single readings far from both neighbours, from a loose contact or a faulty converter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ, coarse
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.inspection import (
    LOUD_NOISE,
    LOUD_TOGETHER,
    SPIKE_NOISE,
    SPIKY_PER_S,
    STILL,
)
from daq_app.rocking.geometry.noise import white_noise

Mask = NDArray[np.bool_]
_REST_S = 0.45
"""Rest at the end of a record from which noise is read, s."""
AROUND_S = 0.03
"""Samples so near to a loud one belong to the same impact."""
_MOVES_WITHIN_S = 0.1
"""Time over which a wall is seen to move …"""
_AROUND_MOTION_S = 0.5
"""… and the time around that in which it may: at the top of a half-cycle, or in the last small ones."""
_BEND_NOISE = 1.22
"""Rms, over that of white noise, of a sample's distance from the mean of its neighbours: √1.5."""


def reading_noise(run: GapRun, index: int) -> float:
    """Rms noise of one reading of a channel, SI: that at rest or the declared one, whichever is larger."""
    rest = white_noise(run.channels[index][-int(_REST_S * run.rate_hz) :]) + 1e-15
    return max(rest, run.sensors[index].noise_si)


@dataclass(frozen=True, slots=True)
class LoneSamples:
    """How often single samples of one channel stand alone in one run."""

    per_s: float = 0.0
    """All of them over the time that is looked at, 1/s."""
    still: int = 0
    """Those while the wall stands still …"""
    still_s: float = 0.0
    """… and for how long it does, s."""


NO_LONE_SAMPLES = LoneSamples()


def lone_samples(
    values: FloatArray, noise: float, rate_hz: float, still: Mask, where: Mask | None = None
) -> LoneSamples:
    """Samples that stand alone: far from the mean of both neighbours, which agree.

    `values`: (n,); `noise`: rms of one sample; `still`: where the wall stands still, (n,); `where`: samples
    that count, (n,), all if left out.
    """
    bent = np.abs(_bend(values))
    alone = (bent > SPIKE_NOISE * _BEND_NOISE * noise) & (np.abs(values[2:] - values[:-2]) < 0.5 * bent)
    seen = np.ones_like(still) if where is None else where
    alone &= seen[1:-1]
    seen_s = max(float(seen.sum()) / rate_hz, 1e-9)
    at_rest = int((alone & still[1:-1]).sum())
    return LoneSamples(float(alone.sum()) / seen_s, at_rest, float((still & seen).sum()) / rate_hz)


def often_alone(of_runs: Sequence[LoneSamples]) -> bool:
    """Whether one channel has lone samples as a loose contact has them: often, and on a wall at rest as well.

    A contact or a converter does not know whether the wall moves. What comes with the motion alone is the
    shock of an impact, or a cable that it shakes.
    """
    still, still_s = sum(run.still for run in of_runs), sum(run.still_s for run in of_runs)
    at_most = (math.sqrt(still) + 1.0) ** 2  # two sd of a count above it
    return float(np.mean([run.per_s for run in of_runs])) > SPIKY_PER_S and at_most > SPIKY_PER_S * still_s


def still_samples(run: GapRun) -> Mask:
    """Samples, (n,), around which neither wires nor LVDTs move: the wall is held, or has come to rest."""
    count = run.channels.shape[1]
    places = [i for i in (*run.indices("wire"), *run.indices("lvdt")) if run.reads(i)]
    if not places:
        return np.zeros(count, dtype=np.bool_)
    apart = round(_MOVES_WITHIN_S * GRID_HZ)
    shown = coarse(run.channels[places], run.rate_hz)
    moved = np.abs(shown[:, apart:] - shown[:, :-apart]) / (np.ptp(shown, axis=1)[:, None] + 1e-15)
    moves = np.pad(np.median(moved, axis=0) > STILL, (apart // 2, apart - apart // 2))
    moves = maximum_filter1d(moves, 2 * round(_AROUND_MOTION_S * GRID_HZ) + 1)
    at = np.minimum(np.arange(count) // round(run.rate_hz / GRID_HZ), moves.size - 1)
    return np.asarray(~moves[at])


def shaken_samples(run: GapRun) -> Mask | None:
    """Samples, (n,), around which several accelerometers are loud: an impact, whatever its shock is like.

    None with fewer accelerometers, which cannot tell the shock of an impact from a lone sample.
    """
    loud: list[Mask] = []
    for index in run.indices("accelerometer"):
        bend = _bend(run.channels[index])
        if np.all(np.isfinite(bend)) and run.sensors[index].id not in run.excluded:
            loud.append(np.pad(np.abs(bend) > LOUD_NOISE * _BEND_NOISE * reading_noise(run, index), 1))
    if len(loud) < LOUD_TOGETHER:
        return None
    width = 2 * round(AROUND_S * run.rate_hz) + 1
    together = np.sum([maximum_filter1d(one, width) for one in loud], axis=0) >= LOUD_TOGETHER
    return np.asarray(together, dtype=np.bool_)


def _bend(values: FloatArray) -> FloatArray:
    """How far each sample is from the mean of its neighbours, shape (n − 2,)."""
    return np.asarray(values[1:-1] - 0.5 * (values[2:] + values[:-2]), dtype=np.float64)

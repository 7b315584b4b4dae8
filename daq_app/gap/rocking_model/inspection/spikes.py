"""Lone samples: single readings far from both neighbours, from a loose contact or a faulty converter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.inspection import LOUD_NOISE, LOUD_TOGETHER, SPIKE_NOISE
from daq_app.rocking.geometry.noise import white_noise

Mask = NDArray[np.bool_]
_REST_S = 0.45
"""Rest at the end of a record from which noise is read, s."""
AROUND_S = 0.03
"""Samples so near to a loud one belong to the same impact."""
_BEND_NOISE = 1.22
"""Rms, over that of white noise, of a sample's distance from the mean of its neighbours: √1.5."""


def reading_noise(run: GapRun, index: int) -> float:
    """Rms noise of one reading of a channel, SI: that at rest or the declared one, whichever is larger."""
    rest = white_noise(run.channels[index][-int(_REST_S * run.rate_hz) :]) + 1e-15
    return max(rest, run.sensors[index].noise_si)


def lone_samples_per_s(values: FloatArray, noise: float, rate_hz: float, where: Mask | None = None) -> float:
    """Samples per second that stand alone: far from the mean of both neighbours, which agree.

    `values`: (n,); `noise`: rms of one sample; `where`: samples that count, (n,), all if left out.
    """
    bent = np.abs(_bend(values))
    alone = (bent > SPIKE_NOISE * _BEND_NOISE * noise) & (np.abs(values[2:] - values[:-2]) < 0.5 * bent)
    return float(np.sum(alone if where is None else alone & where[1:-1])) / values.size * rate_hz


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

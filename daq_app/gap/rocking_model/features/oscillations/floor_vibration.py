"""Does the floor vibrate? A sinusoid that the accelerometers show while the wall is held and after it rests.

The frequency is common to all runs, the phase is each run's own. While the wall is held it may sway;
what a sway implies at the accelerometers is taken out with the rotation's own record. A wall that bends rings
on after it has come to rest, at a frequency of its own, which is no floor's: that is taken out as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core.features import FloatArray, independent_fraction
from daq_app.gap.rocking_model.features.noise import nats_explained
from daq_app.gap.rocking_model.features.oscillations.rings import Ring, ring_columns
from daq_app.gap.rocking_model.features.oscillations.vibration import Vibration
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.quiet import quiet
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ, gridded
from daq_app.gap.rocking_model.motion.sway import sway
from daq_app.gap.rocking_model.records import GRAVITY_M_S2, GapRun
from daq_app.gap.rocking_model.tolerances.walls import FLOOR_GAIN, OSCILLATION_INDEPENDENT

FREQUENCIES_HZ = np.arange(0.4, 6.0, 0.02)
_MARGINS_S = (0.05, 0.3)
"""Before the release and after the rest, where the wall may move already and still."""
_SHORTEST, _ENOUGH = 60, 120
"""Samples of the grid in a part that is used, and in both."""


@dataclass(frozen=True, slots=True)
class QuietRecord:
    """What accelerometers show of the floor while the wall is held and after it rests."""

    time_s: FloatArray
    each: FloatArray
    """(k, n) what nothing but the floor and noise explains, of every accelerometer."""
    basis: FloatArray
    """(n, b) orthonormal: what explains the rest."""

    @property
    def left(self) -> FloatArray:
        """(n,) the mean of all accelerometers."""
        return np.asarray(self.each.mean(axis=0))


def find_vibration(
    runs: Sequence[GapRun], grids: Sequence[Grid], ring: Ring | None = None
) -> list[Vibration | None]:
    """Vibration of every run at the one frequency that explains most; None where nothing can be said.

    `ring` is the wall's own ring-down after impacts.
    """
    usable, data, gain = _seen(runs, grids, None)
    if ring is not None and usable and ring.decays and ring.gain > float(gain.max()):
        # What follows the impacts better than an even wave follows the quiet parts is the wall's own.
        usable, data, gain = _seen(runs, grids, ring)
    if not usable:
        return [None] * len(runs)
    best = float(FREQUENCIES_HZ[int(np.argmax(gain))])
    significant = float(gain.max()) > FLOOR_GAIN * len(usable)
    fine = best + np.linspace(-0.03, 0.03, 31)
    sharp = np.sum([_gain(d, fine) for d in usable], axis=0)
    best = float(fine[int(np.argmax(sharp))])
    bend = float(np.gradient(np.gradient(sharp, fine[1] - fine[0]), fine[1] - fine[0]).min())
    sd = float(1.0 / np.sqrt(max(-bend, 1.0)))
    return [None if d is None else _share(d, best, sd, significant) for d in data]


def _seen(
    runs: Sequence[GapRun], grids: Sequence[Grid], ring: Ring | None
) -> tuple[list[QuietRecord], list[QuietRecord | None], FloatArray]:
    """(usable parts, parts of each run, gain of each frequency) without the ring-down of `ring`."""
    data = [quiet_record(run, grid, ring) for run, grid in zip(runs, grids, strict=True)]
    usable = [d for d in data if d is not None]
    gains = [_gain(d, FREQUENCIES_HZ) for d in usable]
    return usable, data, np.sum(gains, axis=0) if gains else np.zeros(FREQUENCIES_HZ.size)


def without_vibration(run: GapRun, grid: Grid, found: Vibration) -> GapRun:
    """The run whose accelerometers show the wall alone: beside inertia a floor's wave looks like a gain."""
    count = run.channels.shape[1]
    time_s = grid.time_s[0] + (np.arange(count) + 0.5) / run.rate_hz - 0.5 / GRID_HZ
    angle = 2.0 * np.pi * found.frequency_hz * time_s + found.phase
    wave = found.amplitude * np.sin(angle) * np.cos(np.interp(time_s, grid.time_s, grid.theta))
    channels = run.channels.copy()
    for i in run.indices("accelerometer", "x"):
        if not run.sensors[i].ac_coupled:
            channels[i] -= wave
    return replace(run, channels=channels)


def quiet_record(run: GapRun, grid: Grid, ring: Ring | None) -> QuietRecord | None:
    """The accelerometers along x while the wall is held and rests; None for too short a time.

    `ring` is the wall's own ring-down after impacts.
    """
    chosen = run.steady_accelerometers("x")
    if not chosen:
        return None
    height = float(run.positions(chosen)[:, 2].mean())
    calm = quiet(run, grid)
    held, resting = calm & (grid.time_s < -_MARGINS_S[0]), calm & (grid.time_s > grid.rest_s + _MARGINS_S[1])
    # Too short a part says nothing, but the other may: a quick pull leaves a swaying wall.
    held, resting = held & (held.sum() >= _SHORTEST), resting & (resting.sum() >= _SHORTEST)
    pick = held | resting
    if pick.sum() < _ENOUGH:
        return None
    # The held wall sways, and a compliant joint does at rest: its own rotation says by how much.
    before, after = grid.time_s < 0.0, grid.time_s > grid.rest_s
    sway = [column for part in (before, after) for column in _sway(grid.raw, part, height)]
    own = [] if ring is None else _rings_on(grid, ring, resting)
    columns = np.column_stack([held, resting, *sway, *own])[pick].astype(float)
    columns[:, 2:] /= np.abs(columns[:, 2:]).max(axis=0) + 1e-30
    basis, _ = np.linalg.qr(columns[:, np.any(columns != 0.0, axis=0)])
    measured = np.array([gridded(run, i)[pick] for i in chosen])
    if np.ptp(measured, axis=1).max() == 0.0:
        return None  # between two steps of their converters they say nothing
    return QuietRecord(grid.time_s[pick], measured - (measured @ basis) @ basis.T, basis)


def _rings_on(grid: Grid, ring: Ring, resting: NDArray[np.bool_]) -> list[FloatArray]:
    """The ring-down of the wall in the part at rest, and the same of a frequency a little off."""
    waves = ring_columns(grid, ring.frequency_hz, ring.zeta) * resting[:, None]
    since = (grid.time_s - grid.rest_s)[:, None]
    return list(np.hstack([waves, waves * since, waves * since**2]).T)


def _sway(rotation: FloatArray, part: NDArray[np.bool_], height: float) -> list[FloatArray]:
    """What a rotation of the wall in one part of the run makes of the accelerometers, and of late ones."""
    shown = np.zeros((3, rotation.size))
    if part.sum() >= _SHORTEST:
        theta, twice = sway(rotation, part)
        shown[:, part] = -GRAVITY_M_S2 * theta, height * twice, np.gradient(height * twice, 1 / GRID_HZ)
    return list(shown)


def _gain(data: QuietRecord, frequencies: FloatArray) -> FloatArray:
    """Gain in log likelihood of a sinusoid of each frequency."""
    values = data.left
    return nats_explained(values, _fit(data, values, frequencies)[1], OSCILLATION_INDEPENDENT)


def _fit(
    data: QuietRecord, values: FloatArray, frequencies: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sine and cosine, (k, 2), explained power, (k,), inverse Gram matrix, (k, 2, 2), of k sinusoids."""
    waves = sinusoids(frequencies, data.time_s)
    waves = waves - (waves @ data.basis) @ data.basis.T
    inverse: FloatArray = np.asarray(
        np.linalg.inv(waves @ waves.transpose(0, 2, 1) + 1e-9 * np.eye(2)), dtype=np.float64
    )
    projected = waves @ values
    sizes = (inverse @ projected[:, :, None])[:, :, 0]
    return sizes, np.sum(projected * sizes, axis=1), inverse


def sinusoids(frequencies_hz: FloatArray, time_s: FloatArray) -> FloatArray:
    """Sine and cosine of each frequency (k,) at times (n,), (k, 2, n)."""
    angle = 2.0 * np.pi * frequencies_hz[:, None] * time_s
    return np.stack([np.sin(angle), np.cos(angle)], axis=1)


def _share(data: QuietRecord, frequency: float, frequency_sd: float, found: bool) -> Vibration:
    values = data.left
    ((sine, cosine),), (explained,), (inverse,) = _fit(data, values, np.array([frequency]))
    left = max(float(values @ values) - float(explained), 0.0)
    fraction = max(independent_fraction(values), OSCILLATION_INDEPENDENT) if not found else 0.3
    variance = left / values.size / fraction
    sd = float(np.sqrt(variance * 0.5 * np.trace(inverse)))
    amplitude = float(np.hypot(sine, cosine))
    # The phase is read where the wall stands and used where it moves, half a record away.
    apart = 0.5 * float(np.ptp(data.time_s))
    phase_sd = float(np.hypot(sd / max(amplitude, sd), 2.0 * np.pi * frequency_sd * apart))
    return Vibration(frequency, frequency_sd, amplitude, sd, float(np.arctan2(cosine, sine)), phase_sd, found)

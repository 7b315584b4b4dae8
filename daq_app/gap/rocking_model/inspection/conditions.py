"""What the electronics do to a channel, seen in its own samples: hum, quantisation, frozen samples, spikes.

None of these needs a fit of the wall. Each becomes a finding: a number with its error that is zero on a
healthy channel, and which only the effect of that name predicts to be anything else.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.signal import butter, sosfiltfilt

from daq_app.config.rig import Family
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.run_findings import RunFinding
from daq_app.gap.rocking_model.inspection.spikes import (
    AROUND_S,
    NO_LONE_SAMPLES,
    LoneSamples,
    Mask,
    lone_samples,
    often_alone,
    reading_noise,
    shaken_samples,
    still_samples,
)
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.inspection import (
    A_STEP,
    BESIDE_STEPS,
    BEYOND_HUM,
    CONVERTER_STEP,
    FEWEST_STEPS,
    FROZEN_S,
    FROZEN_SD,
    GOES_ON_STEPS,
    HUM_SD,
    IN_STEPS,
    OFF_STEP,
    RANGE_MARGIN,
    SMALLEST_STEP,
    SPIKES_SD_PER_S,
    STANDS_OUT,
    STEP_SD,
    USUAL_HUM,
)
from daq_app.rocking.geometry.noise import white_noise

MAINS_HZ = 50.0
_SLOW_S = 0.1
"""Means over which a record that is turned back by the mains frequency keeps 0.6 Hz to a per cent."""
_FAMILIES: tuple[Family, ...] = ("lvdt", "wire", "accelerometer")


@dataclass(frozen=True, slots=True)
class Condition:
    """What the samples of one channel in one run say."""

    hum_si: float = 0.0
    hum_sd: float = 1.0
    hum_wave: FloatArray | None = None
    """The hum itself, shape (n,), where there is any."""
    step_si: float = 0.0
    frozen_share: float = 0.0
    lone: LoneSamples = NO_LONE_SAMPLES
    noise_si: float = 0.0
    """Rms noise of one reading: that of this record or the declared one, whichever is larger."""


def inspect_channel(run: GapRun, index: int, still: Mask, shaken: Mask | None = None) -> Condition:
    """Examine one channel of one run; NaN anywhere means that nothing is examined.

    `still`: samples, (n,), at which the wall stands still. `shaken`: those around impacts, where an
    accelerometer is not looked at for lone samples.
    """
    values = run.channels[index]
    if not run.reads(index):
        return Condition()
    rate, accelerometer = run.rate_hz, run.sensors[index].family == "accelerometer"
    hum, hum_sd, wave = _hum(values, rate)
    usual = reading_noise(run, index)
    clean = values if wave is None else values - wave
    if accelerometer:
        lone = NO_LONE_SAMPLES if shaken is None else lone_samples(clean, usual, rate, still, ~shaken)
        return Condition(hum, hum_sd, wave, lone=lone, noise_si=usual)
    step = _quantisation_step(values, run.sensors[index].noise_si)
    frozen = _frozen(values, rate, step, run.sensors[index].range_si)
    # A channel that rests at the end of its range shows no noise there.
    lone = lone_samples(clean, usual, rate, still) if step == 0.0 and frozen == 0.0 else NO_LONE_SAMPLES
    return Condition(hum, hum_sd, wave, step, frozen, lone, usual)


def _hum(values: FloatArray, rate_hz: float) -> tuple[float, float, FloatArray | None]:
    """(amplitude, its sd, the wave over the record) of the mains frequency, from the rest at the end."""
    count = round(0.6 * rate_hz)
    if np.ptp(values[-count:]) == 0.0:  # between two steps of its converter
        return 0.0, 0.0, None
    rest = values[-count:] - values[-count:].mean()
    design, inverse = _mains_at_rest(count, rate_hz)
    coefficients = inverse @ rest
    left = rest - design @ coefficients
    noise = float(np.sqrt(np.mean(left**2)))
    sd = noise * np.sqrt(2.0 / count)
    amplitude = float(np.hypot(*coefficients[:2]))
    if amplitude < HUM_SD * sd:
        return 0.0, float(sd), None
    # Over the whole record the frequency is sharp enough for the phase to hold.
    high = values - sosfiltfilt(butter(2, 25.0, fs=rate_hz, output="sos"), values)
    # An impact has some of every frequency: its own share, taken for hum, would ring around every impact.
    loud = np.abs(high) > BEYOND_HUM * float(np.hypot(noise, amplitude))
    calm = ~maximum_filter1d(loud, 2 * round(AROUND_S * rate_hz) + 1, mode="constant")
    calm = calm if calm.sum() > count else np.ones_like(calm)
    waves = _waves(values.size, rate_hz, _sharpened(np.where(calm, high, 0.0), rate_hz))
    seen = waves * calm
    wave = np.linalg.solve(seen @ waves.T, seen @ high) @ waves
    # A little hum is on every long cable. It is taken out, but it is nothing to be explained.
    shown = amplitude if amplitude > USUAL_HUM * noise else 0.0
    return shown, float(sd), np.asarray(wave, dtype=float)


def _sharpened(values: FloatArray, rate_hz: float) -> float:
    """The frequency near that of the mains at which a record has most power, Hz.

    Turned back by the mains frequency, what is left goes round slowly: means over 0.1 s keep it.
    """
    block = round(_SLOW_S * rate_hz)
    count = values.size // block
    turned = (values * _mains_phasor(values.size, rate_hz))[: count * block]
    slow = turned.reshape(count, block).mean(axis=1)
    offsets = np.linspace(-0.6, 0.6, 25)
    angles = 2.0 * np.pi * np.outer(offsets, _SLOW_S * np.arange(count))
    return MAINS_HZ + float(offsets[int(np.argmax(np.abs(np.exp(-1j * angles) @ slow)))])


@lru_cache(maxsize=2)
def _mains_phasor(count: int, rate_hz: float) -> NDArray[np.complex128]:
    """exp(−2πi f t) of the mains frequency, shape (count,)."""
    turning: NDArray[np.complex128] = np.exp(-2j * np.pi * MAINS_HZ * np.arange(count) / rate_hz)
    return turning


@lru_cache(maxsize=2)
def _mains_at_rest(count: int, rate_hz: float) -> tuple[FloatArray, FloatArray]:
    """Wave of the mains, offset and slope over `count` samples, (count, 4), and their pseudo-inverse."""
    design = np.array([*_waves(count, rate_hz, MAINS_HZ), np.ones(count), np.arange(count) / rate_hz]).T
    return design, np.linalg.pinv(design)


def _waves(count: int, rate_hz: float, frequency_hz: float) -> FloatArray:
    """Sine and cosine, (2, count)."""
    angle = 2.0 * np.pi * frequency_hz / rate_hz * np.arange(count)
    return np.array([np.sin(angle), np.cos(angle)])


def _quantisation_step(values: FloatArray, noise_si: float) -> float:
    """Step of a reading that only takes values a step apart; 0 where it does not.

    From sample to sample such a reading stays, or goes on by whole steps; noise does neither.
    """
    change = np.abs(np.diff(values))
    top = _quantile(change, 0.9995)
    large = change > A_STEP * top
    if top <= 0.0 or np.mean(large) < FEWEST_STEPS:
        return 0.0
    rest = float(np.sqrt(np.mean(change[~large] ** 2)))
    if rest > BESIDE_STEPS * top:  # their median is smaller still, and takes longer to find
        return 0.0
    step = float(np.median(change[large]))
    whole = change[large] / step
    if rest > BESIDE_STEPS * step or np.mean(np.abs(whole - np.round(whole)) < OFF_STEP) < IN_STEPS:
        return 0.0
    own = step < CONVERTER_STEP * noise_si or step < SMALLEST_STEP * float(np.ptp(values))
    return 0.0 if own else step  # the converter's own step is none


def _quantile(values: FloatArray, share: float) -> float:
    """As `np.quantile`, in a tenth of its time for one share of a long row."""
    at = share * (values.size - 1)
    low = int(at)
    high = min(low + 1, values.size - 1)
    ordered = np.partition(values, (low, high))
    return float(ordered[low] + (at - low) * (ordered[high] - ordered[low]))


def _frozen(values: FloatArray, rate_hz: float, step: float, limits: tuple[float, float]) -> float:
    """Share of the record in which the reading stands still although it should not."""
    inside = (values > limits[0] + RANGE_MARGIN * np.abs(limits[0])) & (
        values < limits[1] * (1 - RANGE_MARGIN)
    )
    # Standing exactly at its largest or smallest reading a channel clips; it is not frozen.
    inside &= (values != values.max()) & (values != values.min())
    same = (np.diff(values) == 0.0) & inside[1:]
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(np.int8), [0]])))
    starts, stops = edges[::2], edges[1::2]
    long = stops - starts > FROZEN_S * rate_hz
    if not long.any():
        return 0.0
    coarsest = max(step, _resolution(values))
    if white_noise(values) < coarsest:
        # Between two steps of its converter, or of a coarser quantisation, a sound reading stands still too,
        # but then it goes on by one of them. Noise of more than a step keeps it moving on a wall at rest.
        after = np.minimum(stops + 1, values.size - 1)
        long &= np.abs(values[after] - values[starts]) > GOES_ON_STEPS * coarsest
    return float((stops - starts)[long].sum()) / values.size


def _resolution(values: FloatArray) -> float:
    """Step of the converter behind a reading: the least that it changes by; 0 for one that never changes."""
    change = np.abs(np.diff(values))
    change = change[change > 0.0]
    return _quantile(change, 0.01) if change.size > 1 else 0.0


def conditions_of(runs: Sequence[GapRun]) -> list[dict[str, Condition]]:
    """Conditions of every LVDT, wire and accelerometer, by id, run by run."""
    found = []
    for run in runs:
        still, shaken = still_samples(run), shaken_samples(run)
        found.append(
            {
                sensor.id: inspect_channel(run, i, still, shaken)
                for i, sensor in enumerate(run.sensors)
                if sensor.family in _FAMILIES and sensor.id not in run.excluded
            }
        )
    return found


def without_hum(run: GapRun, conditions: dict[str, Condition]) -> GapRun:
    """The run less the hum of its channels."""
    waves = {i: conditions[s.id].hum_wave for i, s in enumerate(run.sensors) if s.id in conditions}
    if all(wave is None for wave in waves.values()):
        return run
    channels = run.channels.copy()
    for i, wave in waves.items():
        if wave is not None:
            channels[i] -= wave
    return replace(run, channels=channels)


def findings_per_run(
    runs: Sequence[GapRun], conditions: Sequence[dict[str, Condition]]
) -> list[list[RunFinding]]:
    """Findings of all runs. Each condition carries the same key in every run: a channel, or its family."""
    findings: list[list[RunFinding]] = [[] for _ in runs]
    for family in _FAMILIES:
        ids = [s.id for s in runs[0].sensors if s.family == family and s.id in conditions[0]]
        rows = [[of_run[name] for name in ids] for of_run in conditions]
        if not ids:
            continue
        noise = float(np.median([[c.noise_si for c in row] for row in rows]))
        # Every channel has a lone sample now and then: what counts is how many it has in all runs.
        spiky = [often_alone([c.lone for c in of_channel]) for of_channel in zip(*rows, strict=True)]
        seen = [[_seen(c, often) for c, often in zip(row, spiky, strict=True)] for row in rows]
        for name, words in _WORDS.items():
            if family == "accelerometer" and name not in ("hum", "spikes"):
                continue
            cells = [[of_channel[name] for of_channel in row] for row in seen]
            unit = _UNITS.get(name) or ("m/s²" if family == "accelerometer" else "m")
            rms = noise if name in ("hum", "quantisation") else math.nan
            for key, chosen in _attribute_condition(family, ids, cells):
                for run_findings, row in zip(findings, cells, strict=True):
                    value, sd = _median_with_sd(name, [row[k] for k in chosen] if chosen else row)
                    run_findings.append(RunFinding(f"{name}@{key}", words, unit, value, sd, rms))
    return findings


_WORDS = {
    "hum": "hum of the mains",
    "quantisation": "step of the reading",
    "dropout": "share of frozen samples",
    "spikes": "lone samples",
}
_UNITS = {"dropout": "1", "spikes": "1/s"}
"""Units of the conditions that have not that of the channel."""
_Seen = tuple[float, float, bool]
"""Size of a condition, its sd, and whether the channel has it."""


def _seen(condition: Condition, often: bool) -> dict[str, _Seen]:
    """What each condition of one channel in one run is; `often`: it has lone samples often, in all runs."""
    c = condition
    return {
        "hum": (c.hum_si, c.hum_sd, c.hum_si > 0.0),
        "quantisation": (c.step_si, STEP_SD * c.step_si, c.step_si > 0.0),
        "dropout": (c.frozen_share, FROZEN_SD, c.frozen_share > FROZEN_SD),
        "spikes": (c.lone.per_s, SPIKES_SD_PER_S, often),
    }


def _attribute_condition(
    family: str, ids: Sequence[str], cells: Sequence[Sequence[_Seen]]
) -> list[tuple[str, list[int]]]:
    """(name, places) of who has a condition: one channel, or the family when several or none have it.

    A channel that has far more of it than the others of the family stands for itself beside them.
    """
    share = np.mean([[seen for _, _, seen in row] for row in cells], axis=0)
    size = np.median([[value for value, _, _ in row] for row in cells], axis=0)
    having = [int(k) for k in np.flatnonzero(share >= 0.5)]
    if len(having) == 1:
        return [(ids[having[0]], having)]
    most = max(having, key=lambda k: float(size[k]), default=0)
    others = [k for k in having if k != most]
    if len(others) > 1 and size[most] > STANDS_OUT * max(float(size[k]) for k in others):
        return [(family, others), (ids[most], [most])]
    return [(family, having)]


def _median_with_sd(name: str, cells: Sequence[_Seen]) -> tuple[float, float]:
    """(value, sd) over the channels chosen: their median, or nothing where none has it."""
    having = np.array([(value, sd) for value, sd, seen in cells if seen])
    if not having.size:
        noise = float(np.median([sd for _, sd, _ in cells]))
        return 0.0, _NONE.get(name, 3.0 * noise)
    middle, sd = np.median(having, axis=0).tolist()
    spread = float(np.std(having[:, 0])) / math.sqrt(len(having))
    return middle, math.hypot(sd, spread) + 1e-3 * middle


_NONE = {"quantisation": 1e-5, "dropout": FROZEN_SD, "spikes": SPIKES_SD_PER_S}
"""Error of "there is none": well below what would be found."""

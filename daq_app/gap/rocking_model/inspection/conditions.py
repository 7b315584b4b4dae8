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
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.signal import butter, sosfiltfilt, sosfreqz

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
    OF_CONVERTER,
    OFF_STEP,
    RANGE_MARGIN,
    SMALLEST_STEP,
    SPIKES_SD_PER_S,
    STANDS_OUT,
    STEP_SD,
    USUAL_HUM,
)
from daq_app.rocking.geometry.noise import white_noise

MAINS_HZ = (50.0, 60.0)
_SLOW_S = 0.1
"""Means over which a record that is turned back by the mains frequency keeps 0.6 Hz to a per cent."""
_SWELLS_S, _MOST_SWELLS = 1.25, 12
"""Time in which the mains may change, and the order of the polynomial up to which they are followed."""
_LEAST_CALM = 0.3
"""Share of a mean over 0.1 s that must be calm."""
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
    seen = {}
    for mains_hz in MAINS_HZ:
        design, inverse = _mains_at_rest(count, rate_hz, mains_hz)
        coefficients = inverse @ rest
        left = float(np.sqrt(np.mean((rest - design @ coefficients) ** 2)))
        seen[mains_hz] = float(np.hypot(*coefficients[:2])), left
    mains_hz = max(seen, key=lambda hz: seen[hz][0])
    amplitude, noise = seen[mains_hz]
    sd = noise * np.sqrt(2.0 / count)
    if amplitude < HUM_SD * sd:
        return 0.0, float(sd), None
    low_pass, kept = _below_mains(rate_hz, mains_hz)
    high = values - sosfiltfilt(low_pass, values)
    # An impact has some of every frequency: its own share, taken for hum, would ring around every impact.
    loud = np.abs(high) > BEYOND_HUM * float(np.hypot(noise, amplitude))
    calm = ~maximum_filter1d(loud, 2 * round(AROUND_S * rate_hz) + 1, mode="constant")
    calm = calm if calm.sum() > count else np.ones_like(calm)
    wave = _mains(high, calm, rate_hz, mains_hz) / kept
    # A little hum is on every long cable. It is taken out, but it is nothing to be explained.
    shown = amplitude if amplitude > USUAL_HUM * noise else 0.0
    return shown, float(sd), wave


def _mains(values: FloatArray, calm: NDArray[np.bool_], rate_hz: float, mains_hz: float) -> FloatArray:
    """The wave near the mains frequency, (n,), that the calm samples of a record show.

    Its frequency is that of most power; its size and phase change over seconds, as those of the mains do.
    Turned back by the nominal frequency, what is left goes round slowly: means over 0.1 s keep it.
    """
    block = round(_SLOW_S * rate_hz)
    count = values.size // block
    phasor = _mains_phasor(values.size, rate_hz, mains_hz)
    used = calm[: count * block].reshape(count, block)
    turned = (values * phasor)[: count * block].reshape(count, block)
    share = used.mean(axis=1)
    slow = (turned * used).mean(axis=1) / np.maximum(share, _LEAST_CALM)
    time_s: FloatArray = np.asarray(_SLOW_S * (np.arange(count) + 0.5), dtype=np.float64)
    turn = np.exp(2j * np.pi * _most_power(slow * share, time_s) * time_s)
    # Legendre's polynomials: those of a low order follow what changes over some seconds.
    order = min(int(values.size / rate_hz / _SWELLS_S), _MOST_SWELLS)
    shapes = legvander(np.linspace(-1.0, 1.0, count), order)
    weights = np.sqrt(np.where(share < _LEAST_CALM, 0.0, share))
    sizes, *_ = np.linalg.lstsq(shapes * weights[:, None], slow / turn * weights, rcond=None)
    smooth = np.interp(np.arange(values.size) / rate_hz, time_s, (shapes @ sizes) * turn)
    return np.asarray(2.0 * np.real(smooth * np.conj(phasor)), dtype=np.float64)


def _most_power(slow: NDArray[np.complex128], time_s: FloatArray) -> float:
    """Frequency within 0.6 Hz, Hz, at which a slow complex record, (k,), has most power."""
    best = 0.0
    # A twentieth of a hertz off, a wave is half a turn off after ten seconds: a dozen times finer each time.
    for reach, step in ((0.6, 0.05), (0.05, 0.004), (0.004, 5e-4)):
        offsets = best + np.arange(-reach, reach + 0.5 * step, step)
        power = np.abs(np.exp(-2j * np.pi * np.outer(offsets, time_s)) @ slow)
        best = float(offsets[int(np.argmax(power))])
    return best


@lru_cache(maxsize=4)
def _below_mains(rate_hz: float, mains_hz: float) -> tuple[FloatArray, float]:
    """Sections of a low pass that is run both ways, and the share of the mains that is above it."""
    sections = butter(2, 25.0, fs=rate_hz, output="sos")
    _, response = sosfreqz(sections, [mains_hz], fs=rate_hz)
    return sections, 1.0 - float(np.abs(response[0]) ** 2)


@lru_cache(maxsize=4)
def _mains_phasor(count: int, rate_hz: float, mains_hz: float) -> NDArray[np.complex128]:
    """exp(−2πi f t) of the mains frequency, shape (count,)."""
    turning: NDArray[np.complex128] = np.exp(-2j * np.pi * mains_hz * np.arange(count) / rate_hz)
    return turning


@lru_cache(maxsize=4)
def _mains_at_rest(count: int, rate_hz: float, mains_hz: float) -> tuple[FloatArray, FloatArray]:
    """Wave of the mains, offset and slope over `count` samples, (count, 4), and their pseudo-inverse."""
    design = np.array([*_waves(count, rate_hz, mains_hz), np.ones(count), np.arange(count) / rate_hz]).T
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
    if rest > OF_CONVERTER * top:  # their median is smaller still, and takes longer to find
        return 0.0
    step = float(np.median(change[large]))
    whole = change[large] / step
    # Between two steps of its own the converter goes to and fro.
    own = _resolution(values) if rest > BESIDE_STEPS * step else 0.0
    beside = own if own < OF_CONVERTER * step else 0.0
    if (
        rest > max(BESIDE_STEPS * step, beside)
        or np.mean(np.abs(whole - np.round(whole)) < OFF_STEP) < IN_STEPS
    ):
        return 0.0
    none = step < CONVERTER_STEP * noise_si or step < SMALLEST_STEP * float(np.ptp(values))
    return 0.0 if none else step  # the converter's own step is none


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

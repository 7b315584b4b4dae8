"""What the electronics do to a channel, seen in its own samples: hum, steps, frozen and lone ones, clipping.

None of these needs a fit of the wall. Each becomes a finding: a number with its error that is zero on a
healthy channel, and which only the effect of that name predicts to be anything else.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from daq_app.config.rig import Family
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.run_findings import RunFinding
from daq_app.gap.rocking_model.inspection.hum import hum_of
from daq_app.gap.rocking_model.inspection.spikes import (
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
    ACCELEROMETER_STEP,
    CLIPPED_SAMPLES,
    CLIPPED_TOPS,
    FLAT_TOP,
    FROZEN_S,
    FROZEN_SD,
    GOES_ON_STEPS,
    INSIDE_RANGE,
    LIMIT_SD,
    LOUD,
    LOUD_SD,
    RANGE_MARGIN,
    SHOCK_IN_NOISE,
    SPIKES_SD_PER_S,
    STANDS_BETWEEN_STEPS,
    STANDS_OUT,
    STEP_SD,
)
from daq_app.rocking.families.channels.coarse_steps import coarse_step, resolution
from daq_app.rocking.geometry.noise import white_noise

_UNIT_OF: dict[Family, str] = {"lvdt": "m", "wire": "m", "accelerometer": "m/s²", "tiltmeter": "rad"}
"""Unit of what each family shows; all of them are looked at."""


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
    limit_si: float = 0.0
    """Reading that an accelerometer goes no further than; 0 where it goes as far as it should."""
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
    hum, hum_sd, wave = hum_of(values, rate)
    usual, limits = reading_noise(run, index), run.sensors[index].range_si
    clean = values if wave is None else values - wave
    if accelerometer:
        step, limit = _step_beside_shocks(values, limits), _clips_at(values, usual, limits)
        lone = NO_LONE_SAMPLES
        if shaken is not None and step == 0.0:
            lone = lone_samples(clean, usual, rate, still, ~shaken)
        return Condition(hum, hum_sd, wave, step, lone=lone, limit_si=limit, noise_si=usual)
    step = coarse_step(values, run.sensors[index].noise_si)
    frozen = _frozen(values, rate, step, limits)
    # A channel that rests at the end of its range shows no noise there.
    lone = lone_samples(clean, usual, rate, still) if step == 0.0 and frozen == 0.0 else NO_LONE_SAMPLES
    return Condition(hum, hum_sd, wave, step, frozen, lone, noise_si=usual)


def _step_beside_shocks(values: FloatArray, limits: tuple[float, float]) -> float:
    """Step of an accelerometer's reading, of which a shock takes many at once; 0 for a converter's own."""
    if np.mean(np.diff(values) == 0.0) < STANDS_BETWEEN_STEPS:
        return 0.0
    step = resolution(values)
    return step if step > ACCELEROMETER_STEP * (limits[1] - limits[0]) else 0.0


def _clips_at(values: FloatArray, noise: float, limits: tuple[float, float]) -> float:
    """Size of the reading at which the tops of an accelerometer are flat, inside its range; 0 for none.

    A shock has one largest sample, or two. One that clips has many that are as large as all others.
    """
    size = np.abs(values)
    largest = float(size.max())
    if largest < SHOCK_IN_NOISE * noise or largest > INSIDE_RANGE * min(abs(end) for end in limits):
        return 0.0
    if np.count_nonzero(size > FLAT_TOP * largest) < CLIPPED_SAMPLES * CLIPPED_TOPS:
        return 0.0
    at_top = size > largest - 1.5 * resolution(values)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], at_top.astype(np.int8), [0]])))
    flat = int(np.sum(edges[1::2] - edges[::2] >= CLIPPED_SAMPLES))
    return largest if flat >= CLIPPED_TOPS else 0.0


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
    coarsest = max(step, resolution(values))
    if white_noise(values) < coarsest:
        # Between two steps of its converter, or of a coarser quantisation, a sound reading stands still too,
        # but then it goes on by one of them. Noise of more than a step keeps it moving on a wall at rest.
        after = np.minimum(stops + 1, values.size - 1)
        long &= np.abs(values[after] - values[starts]) > GOES_ON_STEPS * coarsest
    return float((stops - starts)[long].sum()) / values.size


def conditions_of(runs: Sequence[GapRun]) -> list[dict[str, Condition]]:
    """Conditions of every channel, by id, run by run."""
    found = []
    for run in runs:
        still, shaken = still_samples(run), shaken_samples(run)
        found.append(
            {
                sensor.id: inspect_channel(run, i, still, shaken)
                for i, sensor in enumerate(run.sensors)
                if sensor.family in _UNIT_OF and sensor.id not in run.excluded
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
    for family, of_family in _UNIT_OF.items():
        ids = [s.id for s in runs[0].sensors if s.family == family and s.id in conditions[0]]
        rows = [[of_run[name] for name in ids] for of_run in conditions]
        if not ids:
            continue
        noise = float(np.median([[c.noise_si for c in row] for row in rows]))
        for run_findings, of_run in zip(findings, rows, strict=True):
            run_findings += [*_loud(ids, rows, noise), *_clipped(ids, of_run)]
        # Every channel has a lone sample now and then: what counts is how many it has in all runs.
        spiky = [often_alone([c.lone for c in of_channel]) for of_channel in zip(*rows, strict=True)]
        seen = [[_seen(c, often) for c, often in zip(row, spiky, strict=True)] for row in rows]
        for name, words in _WORDS.items():
            if family == "accelerometer" and name == "dropout":
                continue
            cells = [[of_channel[name] for of_channel in row] for row in seen]
            unit = _UNITS.get(name, of_family)
            rms = noise if name in ("hum", "quantisation") else math.nan
            for key, chosen in _attribute_condition(family, ids, cells, now_and_then=name == "dropout"):
                for run_findings, row in zip(findings, cells, strict=True):
                    value, sd = _median_with_sd(name, [row[k] for k in chosen] if chosen else row)
                    run_findings.append(RunFinding(f"{name}@{key}", words, unit, value, sd, rms))
    return findings


def _loud(ids: Sequence[str], rows: Sequence[Sequence[Condition]], usual: float) -> list[RunFinding]:
    """Channels with more noise than their family has; steps of a reading make some of their own."""
    findings = []
    for name, of_channel in zip(ids, zip(*rows, strict=True), strict=True):
        factor = float(np.median([c.noise_si for c in of_channel])) / usual if usual > 0.0 else 0.0
        if factor > LOUD and not any(c.step_si for c in of_channel):
            findings.append(RunFinding(f"noise@{name}", "noise", "1", factor, LOUD_SD * factor))
    return findings


def _clipped(ids: Sequence[str], row: Sequence[Condition]) -> list[RunFinding]:
    """The accelerometers that clip in one run: the inverse of their limits."""
    seen = ((name, 1.0 / c.limit_si) for name, c in zip(ids, row, strict=True) if c.limit_si > 0.0)
    words, unit = "inverse of the limit", "s²/m"
    return [RunFinding(f"saturation@{name}", words, unit, value, LIMIT_SD * value) for name, value in seen]


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
    family: str, ids: Sequence[str], cells: Sequence[Sequence[_Seen]], *, now_and_then: bool
) -> list[tuple[str, list[int]]]:
    """(name, places) of who has a condition: one channel, or the family when several or none have it.

    It must have it in half of the runs, and in any run where it comes `now_and_then`, as readings that stand
    still do. A channel that has far more of it than the others of the family stands for itself beside them.
    """
    share = np.mean([[seen for _, _, seen in row] for row in cells], axis=0)
    size = np.median([[value for value, _, _ in row] for row in cells], axis=0)
    having = [int(k) for k in np.flatnonzero(share > 0.0 if now_and_then else share >= 0.5)]
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

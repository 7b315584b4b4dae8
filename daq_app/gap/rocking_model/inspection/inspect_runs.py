"""Before anything is fitted: wiring, electronics, single channels, ring-downs and the floor, over all runs.

What is found is taken out of the families where it would spoil them. Conditions of the electronics become
findings of the run; what channels, ring-downs and the floor show becomes blocks of features of its own.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from daq_app.config.rig import Family
from daq_app.gap.core import CannotDiagnose
from daq_app.gap.rocking_model.features.block import Block, scalar_block
from daq_app.gap.rocking_model.features.families.wires import SLIDE, STEADY
from daq_app.gap.rocking_model.features.oscillations.floor_spectrum import floor_spectrum
from daq_app.gap.rocking_model.features.oscillations.floor_vibration import find_vibration, without_vibration
from daq_app.gap.rocking_model.features.oscillations.ring_signals import Signal, ring_signals
from daq_app.gap.rocking_model.features.oscillations.rings import Ring, ring_block, scan, with_repeatability
from daq_app.gap.rocking_model.features.oscillations.vibration import FloorSpectrum, Vibration
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.run_features import Examined, examine
from daq_app.gap.rocking_model.features.run_findings import RunFinding, merged
from daq_app.gap.rocking_model.features.slips.base_slip import slip_findings, slip_of
from daq_app.gap.rocking_model.features.slips.base_walk import by_whole_tests, without_walk
from daq_app.gap.rocking_model.inspection.channel_faults import Lone, channel_block, find_outlier_channels
from daq_app.gap.rocking_model.inspection.conditions import conditions_of, findings_per_run, without_hum
from daq_app.gap.rocking_model.inspection.floor_bursts import floor_bursts
from daq_app.gap.rocking_model.inspection.lone_rings import lone_rings
from daq_app.gap.rocking_model.inspection.play import plays
from daq_app.gap.rocking_model.inspection.quantisation import with_quantisation_errors
from daq_app.gap.rocking_model.inspection.saturation import saturated
from daq_app.gap.rocking_model.inspection.second_axis import second_axis
from daq_app.gap.rocking_model.inspection.tilt_response import unlike_rotation
from daq_app.gap.rocking_model.inspection.vertical import odd_vertical, vertical_block
from daq_app.gap.rocking_model.inspection.wiring import mend
from daq_app.gap.rocking_model.records import GapRun, Wiring
from daq_app.gap.rocking_model.tolerances.inspection import COUNT_SD
from daq_app.gap.rocking_model.tolerances.sensors import LATE_S
from daq_app.gap.rocking_model.tolerances.walls import MIDDLE_OF_IMPACT_S, RINGING_GAIN
from daq_app.rocking.families.base.slip import BaseSlip


@dataclass(frozen=True, slots=True)
class Cleaned:
    """Runs in which wiring and electronics are put right as far as they can be, and what each shows."""

    runs: list[GapRun]
    findings: list[list[RunFinding]]
    wiring: Wiring


@dataclass(frozen=True, slots=True)
class Inspected:
    """Cleaned runs whose channels stop where they really do."""

    runs: list[GapRun]
    findings: list[list[RunFinding]]
    reference: str
    """``wire`` where the LVDTs are not fit to read the motion from, else empty."""
    wiring: Wiring


def inspect(runs: Sequence[GapRun]) -> Cleaned:
    """Mend the wiring, inspect the electronics. Raises nothing: what cannot be judged is left as it is."""
    mended, wiring = mend(list(runs))
    mended = [run.excluding(wiring.reversed_ids) for run in mended]
    conditions = conditions_of(mended)
    findings = findings_per_run(mended, conditions)
    # Readings that stand still or go in steps must be seen as they were; all else is put on one clock.
    clean = [without_hum(run, c).at_clock() for run, c in zip(mended, conditions, strict=True)]
    families: dict[str, Family] = {s.id: s.family for s in runs[0].sensors}
    stairs = [
        name
        for row in conditions
        for name, c in row.items()
        if c.step_si and families[name] == "accelerometer"
    ]
    clean = [run.excluding([*_spoiled(findings, families), *stairs]) for run in clean]
    return Cleaned(clean, merged(findings, [_wiring_findings(wiring, families)] * len(clean)), wiring)


def limited(cleaned: Cleaned) -> Inspected:
    """The runs with the ranges that their channels really have."""
    runs, findings = cleaned.runs, cleaned.findings
    families: dict[str, Family] = {s.id: s.family for s in runs[0].sensors}
    clean, limits = saturated(runs, _steps(findings))
    clean = [run.excluding(_spoiled(limits, families)) for run in clean]
    findings = merged(findings, limits)
    coarse_lvdts = any(m.key == "quantisation@lvdt" and m.value > 0 for row in findings for m in row)
    return Inspected(clean, findings, "wire" if coarse_lvdts else "", cleaned.wiring)


def without_slip(cleaned: Cleaned, slip: BaseSlip) -> Cleaned:
    """The runs as on a base that does not slip, by the slip that all channels show, or by `slip`.

    Runs in which the wall cannot be followed are left as they are.
    """
    examined: list[Examined | None] = []
    for run in cleaned.runs:
        try:
            examined.append(examine(run))
        except CannotDiagnose:
            examined.append(None)
    tests = [e.run for e in examined if e is not None]
    grids = [e.features.grid for e in examined if e is not None]
    again = by_whole_tests(tests, grids, slip_of(tests, grids) or slip)
    runs = [
        replace(run, slip=again) if e is None else without_walk(run, e.run, e.features.grid, again)
        for run, e in zip(cleaned.runs, examined, strict=True)
    ]
    return replace(cleaned, runs=runs)


def _spoiled(findings: Sequence[Sequence[RunFinding]], channels: Collection[str]) -> list[str]:
    """Single channels whose readings are not fit to be used with their family, in any run."""
    return [f.target for row in findings for f in row if f.spoils and f.target in channels]


def _wiring_findings(wiring: Wiring, families: dict[str, Family]) -> list[RunFinding]:
    """Counts of reversed and exchanged channels; the name says which, where there is one."""
    turned, crossed = wiring.reversed_ids, wiring.exchanged
    first = f"polarity@{turned[0]}" if len(turned) == 1 else "polarity"
    second = f"swap@{families[crossed[0][0]]}" if crossed else "swap"
    shown = dict(crossed)
    words = [
        f"{a} and {b} exchanged" if shown[b] == a else f"{a} shows {b}"
        for a, b in crossed
        if shown[b] != a or a < b
    ]
    return [
        RunFinding(first, f"{', '.join(turned) or 'channels'} reversed", "1", float(len(turned)), COUNT_SD),
        RunFinding(second, ", ".join(words) or "channels exchanged", "1", float(wiring.places), COUNT_SD),
    ]


def choose_reference(inspected: Inspected) -> tuple[str, dict[int, Examined]]:
    """What the motion is read from (`examine`): the prompter family where LVDTs and wires differ in time.

    With it what was examined that way on the way to it, by the place of the run.
    """
    if inspected.reference:
        return inspected.reference, {}
    if not inspected.runs[0].indices("lvdt"):
        return "", {}  # what can be said without them, the examination says
    sizes = [float(np.nanmax(np.abs(r.channels[r.indices("lvdt")[0]]))) for r in inspected.runs]
    place = sizes.index(max(sizes))
    run = inspected.runs[place]
    try:
        first = examine(run)
    except (CannotDiagnose, IndexError):
        return "", {}
    lag = _coefficient(first.features, "wire", "lag")
    if first.features.reference != "lvdt" or lag is None or abs(lag) < LATE_S:
        return "", {place: first}
    try:
        second = examine(run, "late")
    except (CannotDiagnose, IndexError):
        return "", {place: first}
    delays = [_coefficient(f.features, "impact timing", "delay") for f in (first, second)]
    if delays[0] is None or delays[1] is None or second.features.reference != "wire":
        return "", {place: first}
    late = [abs(delay - MIDDLE_OF_IMPACT_S) for delay in delays if delay is not None]
    return ("late", {place: second}) if late[1] < late[0] else ("", {place: first})


def _coefficient(run: RockingRun, family: str, name: str) -> float | None:
    for block in run.blocks:
        if block.family == family and name in block.names:
            return float(block.values[block.names.index(name)])
    return None


def _late(run: RockingRun) -> float:
    """How late the accelerometers are, s, where that is more than their timing leaves open."""
    delay = _coefficient(run, "swing timing", "delay") or 0.0
    return delay if abs(delay) > LATE_S else 0.0


def without_outlier_channels(
    examined: Sequence[Examined], findings: Sequence[Sequence[RunFinding]], reference: str
) -> tuple[list[Examined], dict[str, Lone], list[list[RunFinding]]]:
    """The runs less the channels that disagree with their family; single ones; findings with the several.

    What one or two of a family show, effects may explain. More than two have no causes that the library
    knows: that they disagree is a finding that nothing explains, and not a reason to forget them.
    """
    grids = [e.features.grid for e in examined]
    runs = [e.run for e in examined]
    along_z = odd_vertical(runs, grids, [_late(e.features) for e in examined])
    outliers = find_outlier_channels(runs, grids, _steps(findings)).plus("accelerometer", along_z)
    again = _examined_without(examined, outliers.ids, reference)
    gross = _left_out(again).difference(outliers.ids)
    for name in sorted(gross):
        outliers = outliers.plus("lvdt", name)
    if gross:
        again = _examined_without(examined, outliers.ids, reference)
    disagreements = [
        RunFinding(
            f"disagreement@{family}", f"disagreement ({', '.join(names)})", "1", float(len(names)), COUNT_SD
        )
        for family, names in outliers.several.items()
    ]
    odd, tilted = unlike_rotation(again)
    again = _examined_without(again, odd, reference)
    final = [e.run for e in again], [e.features.grid for e in again]
    rows = merged(
        findings,
        [disagreements] * len(again),
        tilted,
        second_axis(*final),
        lone_rings(*final, outliers.ids),
        plays(*final, outliers.ids, _steps(findings)),
    )
    return again, outliers.single, rows


def _examined_without(examined: Sequence[Examined], ids: Sequence[str], reference: str) -> list[Examined]:
    """The runs examined anew less these channels."""
    if not ids:
        return list(examined)
    return [
        examine(replace(e.run.excluding(ids), impacts_before=e.features.impacts_before), reference)
        for e in examined
    ]


def _left_out(examined: Sequence[Examined]) -> set[str]:
    """LVDTs that read and that the plane of the joint was made without, in half of the runs or more."""
    seen: list[str] = []
    for entry in examined:
        whole = {s.id for i, s in enumerate(entry.run.sensors) if entry.run.reads(i)}
        seen += [name for name in entry.joint.left_out if name in whole]
    return {name for name in seen if 2 * seen.count(name) >= len(examined)}


def _steps(findings: Sequence[Sequence[RunFinding]]) -> dict[str, float]:
    """Step of the reading, m, of the families and channels that go in steps."""
    seen: dict[str, list[float]] = {}
    for finding in (finding for row in findings for finding in row):
        if finding.key.startswith("quantisation") and finding.value > 0:
            seen.setdefault(finding.target, []).append(finding.value)
    return {target: float(np.median(values)) for target, values in seen.items()}


def completed(
    examined: Sequence[Examined],
    findings: Sequence[Sequence[RunFinding]],
    channels: dict[str, Lone],
    wiring: Wiring,
) -> list[RockingRun]:
    """Features of all runs with the blocks and findings of what was inspected over all of them.

    Bursts of the floor are looked for once its even vibration is out of the accelerometers.
    """
    grids = [e.features.grid for e in examined]
    height = examined[0].features.survey.height_m
    blocks_by_run: list[list[Block]] = [[] for _ in examined]
    steps = _steps(findings)
    for row, entry in zip(blocks_by_run, examined, strict=True):
        for name, lone in channels.items():
            grid = entry.features.grid
            block = channel_block(entry.run, grid, name, lone, steps.get(lone.family, 0.0))
            if block is None and lone.family == "accelerometer":
                block = vertical_block(entry.run, grid, name, _late(entry.features))
            if block is not None:
                row.append(block)
    signals = [ring_signals(e.run, e.joint, e.features.grid, height) for e in examined]
    bending = _add_rings(blocks_by_run, examined, [bends for bends, _ in signals], "bending", slow=False)
    _add_rings(blocks_by_run, examined, [turns for _, turns in signals], "turning", slow=True)
    vibrations = find_vibration([e.run for e in examined], grids, bending)
    examined = [_on_still_floor(e, v) for e, v in zip(examined, vibrations, strict=True)]
    calm = [e.run for e in examined], [e.features.grid for e in examined]
    floor = floor_spectrum(*calm, bending)
    # A floor that vibrates irregularly is now louder, now less loud: its bursts are nothing else.
    shaken = (
        floor_bursts(*calm, examined[0].features.survey, bending)
        if floor is None
        else [[_irregular(floor, len(examined))] for _ in examined]
    )
    slip = examined[0].run.slip or slip_of(*calm)
    runs = []
    known = with_quantisation_errors(examined, steps)
    rows = merged(findings, shaken, [slip_findings(slip, len(examined))] * len(examined))
    for row, entry, vibration, seen, read in zip(
        blocks_by_run, examined, vibrations, rows, known, strict=True
    ):
        grid = entry.features.grid
        if vibration is not None:
            shown = vibration.amplitude if vibration.found else 0.0
            sd = vibration.amplitude_sd * (1.0 if vibration.found else 3.0)
            entries = (
                ("amplitude", "m/s²", shown, sd**2),
                # It was found from all runs at once: what is said in every run is known only once.
                ("frequency", "Hz", vibration.frequency_hz, len(examined) * vibration.frequency_sd**2),
            )
            row.append(scalar_block("floor", entries, grid))
        told = _with_one_drift(read, rings=_rings(bending, len(examined)))
        features = replace(
            told, vibration=vibration, wiring=wiring, findings=tuple(seen), floor=floor, slip=slip
        )
        runs.append(features.with_blocks(row))
    return runs


def _with_one_drift(run: RockingRun, *, rings: bool) -> RockingRun:
    """The run with the drift of its wires beside their steps at impacts, where these can be told.

    All wires of a wall that rings move together at impacts, and say nothing of slides.
    """
    slides = not rings and any(block.family == SLIDE for block in run.blocks)
    return run.without_block(STEADY if slides else SLIDE)


def _rings(bending: Ring | None, runs: int) -> bool:
    """Whether the wall rings far beyond what sound ones show."""
    return bending is not None and bending.decays and bending.gain > RINGING_GAIN * runs


def _irregular(floor: FloorSpectrum, runs: int) -> RunFinding:
    """The finding of an irregular floor in one of the runs: amplitude of a sinusoid of the same power."""
    size, sd = (math.sqrt(2.0) * value for value in (floor.total_m_s2, floor.sd_m_s2))
    # It is found from all runs at once: what is said in every run is known only once.
    words = f"most at {floor.loudest_hz:.1f} Hz"
    return RunFinding("ambient@floor", words, "m/s²", size, math.sqrt(runs) * sd)


def _on_still_floor(entry: Examined, vibration: Vibration | None) -> Examined:
    """The same without the floor's part in the accelerometers; what it does to the wall stays."""
    if vibration is None or not vibration.found:
        return entry
    still = without_vibration(entry.run, entry.features.grid, vibration)
    return examine(still, entry.wanted)


def _add_rings(
    blocks_by_run: list[list[Block]],
    examined: Sequence[Examined],
    signals: Sequence[list[Signal]],
    name: str,
    *,
    slow: bool,
) -> Ring | None:
    """Blocks of the ring-down that fits best; that oscillator."""
    grids = [e.features.grid for e in examined]
    ring = scan(grids, signals, slow=slow)
    if ring is None:
        return None
    ring_blocks: list[Block] = []
    rows: list[list[Block]] = []
    for row, entry, listed in zip(blocks_by_run, examined, signals, strict=True):
        block = ring_block(name, entry.features.grid, listed, ring, slow=slow)
        if block is not None:
            ring_blocks.append(block)
            rows.append(row)
    for row, block in zip(rows, with_repeatability(ring_blocks), strict=True):
        row.append(block)
    return ring


def found_channels(runs: Sequence[RockingRun]) -> dict[str, str]:
    """Channels with a block of their own, and their families."""
    return {b.family: b.sensor_family for run in runs for b in run.blocks if b.kind == "channel"}


def calibrations(runs: Sequence[RockingRun]) -> dict[str, dict[str, float]]:
    """What each of those channels may be off by in each shape while it is sound, as the others predict it."""
    return {
        b.family: dict(zip(b.names, b.levers, strict=False))
        for run in runs
        for b in run.blocks
        if b.kind == "channel"
    }

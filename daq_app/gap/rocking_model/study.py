"""A diagnosis of recorded tests from beginning to end, with its refusals and stated limits."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from daq_app.gap.core import CannotDiagnose, Diagnosis, Library, Options, diagnose
from daq_app.gap.core.result import Decision, Verdict
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.run_features import Examined, examine
from daq_app.gap.rocking_model.features.run_findings import RunFinding
from daq_app.gap.rocking_model.features.straightness import equally_straight
from daq_app.gap.rocking_model.findings import findings_of
from daq_app.gap.rocking_model.inspection.inspect_runs import (
    Cleaned,
    calibrations,
    choose_reference,
    completed,
    found_channels,
    inspect,
    limited,
    without_outlier_channels,
    without_slip,
)
from daq_app.gap.rocking_model.library import rocking_library
from daq_app.gap.rocking_model.prediction.floor_motion import on_its_floor
from daq_app.gap.rocking_model.prediction.model import RockingModel
from daq_app.gap.rocking_model.prediction.slipping import on_its_base
from daq_app.gap.rocking_model.records import GapRun, check_consistent
from daq_app.gap.rocking_model.tolerances.walls import EITHER, FAR_FROM_SURVEY
from daq_app.workers import warm_up

_SLIDES: Final = ("sliding", "sliding_on", "corner_twist")
"""Effects by which the base moves at impacts."""
PRELOADED: Final = "daq_app.gap.rocking_model.prediction.preloaded"
"""Module that worker processes are forked from."""


def prepare(runs: Sequence[GapRun]) -> tuple[list[RockingRun], list[str]]:
    """Features of all runs in the order of the campaign, and the limits that come from what was left out.

    Raises `CannotDiagnose` where no run can be used, or where runs do not belong together.
    """
    check_consistent(runs)
    limits: list[str] = []
    usable: list[GapRun] = []
    # What wears, wears in the order of the tests, whatever the files are called; unknown times keep theirs.
    for run in sorted(runs, key=lambda run: run.start_utc_ns):
        try:
            usable.append(_without_gaps(run))
        except CannotDiagnose as problem:
            if len(runs) == 1:
                raise
            limits.append(f"Left out. {problem}")
    if not usable:
        raise CannotDiagnose("None of the runs can be used.", " ".join(limits))
    cleaned = inspect(usable)
    whole, stated = _examined(cleaned, limits)
    if whole[0].slip is not None:
        # With the walk of the base in them wires and accelerometers say of others what they do not do.
        whole, stated = _examined(without_slip(cleaned, whole[0].slip), limits)
    return whole, stated


def _examined(cleaned: Cleaned, stated: Sequence[str]) -> tuple[list[RockingRun], list[str]]:
    """Features of all runs, and the limits from what was left out, behind those that are `stated`."""
    inspected = limited(cleaned)
    limits = list(stated)
    reference, known = choose_reference(inspected)
    examined: list[Examined] = []
    findings: list[Sequence[RunFinding]] = []
    impacts = 0.0
    for place, (run, seen) in enumerate(zip(inspected.runs, inspected.findings, strict=True)):
        before = run.impacts_before or impacts
        try:
            first_pass = known.get(place) or examine(run, reference)
        except CannotDiagnose as problem:
            if len(inspected.runs) == 1 and not stated:
                raise
            limits.append(f"Left out. {problem}")
            continue
        entry = first_pass.after(before)
        examined.append(entry)
        findings.append(seen)
        impacts = entry.features.impacts_before + entry.features.swings.impacts
    if not examined:
        raise CannotDiagnose("None of the runs can be used.", " ".join(limits))
    examined, channels, findings_of_all = without_outlier_channels(examined, findings, reference)
    for entry in examined:
        limits += entry.features.notes
    runs_of_all = completed(examined, findings_of_all, channels, inspected.wiring)
    runs_of_all = equally_straight(runs_of_all, [entry.run for entry in examined])
    whole = [on_its_base(on_its_floor(run)) for run in runs_of_all]
    limits += [
        f"{name} disagrees with the other {lone.family} channels; it is examined on its own."
        for name, lone in channels.items()
    ]
    return whole, limits


def _without_gaps(run: GapRun) -> GapRun:
    """The run, or a refusal if samples of all channels are missing in it."""
    missing = np.flatnonzero(np.isnan(run.channels).all(axis=0))
    if missing.size:
        raise CannotDiagnose(
            f"Run {run.name} has a gap of {missing.size} samples from {missing[0] / run.rate_hz:.2f} s on.",
            "Leave it out, or diagnose it with the part before the gap.",
        )
    return run


def diagnose_runs(
    runs: Sequence[GapRun],
    options: Options | None = None,
    only: Collection[str] = (),
) -> Diagnosis:
    """Where, which and how far, for tests of one specimen on one rig.

    With `only`, no effects but these are considered (and no probes): a quick answer to a narrow question.

    Raises `CannotDiagnose` with the reason in words, and `parallel.Interrupted` when stopped.
    """
    if options is not None and options.workers > 1:
        warm_up(PRELOADED)  # while the features are worked out
    prepared, limits = prepare(runs)
    model, library = model_and_library(prepared)
    if only:
        library = library.without(*(name for name in library if name not in only))
        limits.append(f"Only {', '.join(sorted(only))} were considered.")
    return diagnose_prepared(model, prepared, library, options, limits)


def diagnose_prepared(
    model: RockingModel,
    prepared: Sequence[RockingRun],
    library: Library,
    options: Options | None = None,
    limits: Sequence[str] = (),
) -> Diagnosis:
    """The diagnosis of runs whose features are known (`prepare`), with `limits` that are stated already."""
    stated = list(limits)
    if len({run.level for run in prepared}) < 2:
        stated.append(
            "One level only: effects that differ in how they grow with amplitude cannot be told apart."
        )
    if len({np.sign(run.swings.peak_rad[0]) for run in prepared}) < 2:
        stated.append(
            "All releases are to one side: release effects cannot be told from a difference of sides."
        )
    result = diagnose(model, prepared, library, options, stated, findings_of(prepared))
    wiring = prepared[0].wiring
    result.notes["wiring"] = {"reversed": list(wiring.reversed_ids), "exchanged": dict(wiring.exchanged)}
    return _doubt_the_survey(result)


def model_and_library(prepared: Sequence[RockingRun]) -> tuple[RockingModel, Library]:
    """The model with the calibrations of the channels that are examined on their own, and the effects.

    Effects that these runs cannot show at all are left out: vibration of the floor where none is seen, and
    slides and turns at impacts of a base whose slip is measured, for they are a part of it.
    """
    library = rocking_library(found_channels(prepared))
    if not any(run.vibration is not None and run.vibration.found for run in prepared):
        library = library.without("ambient")
    if any(run.slip is not None for run in prepared):
        library = library.without(*_SLIDES)
    shaking = any(run.floor_loadings is not None for run in prepared)
    return RockingModel(prepared[0].survey, calibrations(prepared), on_shaking_floor=shaking), library


def _doubt_the_survey(result: Diagnosis) -> Diagnosis:
    """With α, p or b far from the survey either the rig file is wrong or something unknown moves the wall.

    These runs cannot say which: a wall that turns on other edges looks like another wall. Where not even
    other numbers make the runs fit, the answer stays that none of these explains them.
    """
    far = [
        p
        for p in result.parameters
        if p.name in ("alpha", "p", "half_base")
        and abs(p.value - p.prior_mean) > FAR_FROM_SURVEY * p.prior_sd
    ]
    if not far:
        return result
    words = ", ".join(f"{p.name} = {p.value:.4g} {p.unit} (rig file {p.prior_mean:.4g})" for p in far)
    sentence = f"The runs do not fit the specimen of the rig file: {words}. {result.decision.sentence}"
    old = result.decision
    verdict: Verdict = "none_of_these" if old.verdict == "none_of_these" else "cannot_tell"
    decision = Decision(verdict, old.effects, old.family, sentence, 0.0)
    advice = "Check that the rig file is that of this specimen, and survey its weight, height and base again."
    unknown = max(result.rest.unknown, EITHER)
    less = (1.0 - unknown) / max(1.0 - result.rest.unknown, 1e-9)
    return replace(
        result,
        which=tuple(replace(entry, probability=less * entry.probability) for entry in result.which),
        decision=decision,
        next_measurement=advice,
        rest=replace(result.rest, unknown=unknown),
    )

"""The part of a test record that says what was to be done, by whom, and what came of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from daq_app.campaign.names import level_in
from daq_app.campaign.record.number_text import MISSING, figure, moment, moment_of, said
from daq_app.campaign.record.parts import Grid, Pairs, Part, Section, Tone, Words
from daq_app.campaign.record.picture import record_picture
from daq_app.campaign.record.source import RecordSource
from daq_app.campaign.result.family_rows import CAPTION, HEADINGS, family_rows
from daq_app.campaign.summaries.summary import TestSummary
from daq_app.config.wording import plus_minus, true_minus
from daq_app.rocking.families.verdict_words import verdict_sentence

_METHODS = {
    "CRT": "CRT, rotation peaks (4.5)",
    "EAV": "EAV, velocities two impacts apart (4.4)",
    "fit": "fit of the whole motion",
}
_FAMILIES = {"tiltmeters": "tiltmeters", "wires": "wires", "lvdts": "LVDTs", "best": "wires and LVDTs"}


def identity_section(source: RecordSource) -> Section:
    """Which test, where, when, by whom."""
    header, plan = source.header, source.header.test_plan
    end = source.seconds(source.attributes.first_sample + source.attributes.n_samples)
    rows = [
        ("Test", source.name),
        ("Specimen", _specimen(header.specimen, plan.specimen if plan is not None else "")),
        ("Level", said((plan.level if plan is not None else "") or level_in(source.name))),
        ("Operator", said(plan.operator if plan is not None else "")),
        ("First sample", moment(source.start_utc)),
        ("Length", f"{end:.3f} s, {source.attributes.n_samples} samples of {header.n_channels} channels"),
        ("Recorded by", said(header.host)),
        ("Kind of record", _kind(source)),
    ]
    return Section("1  Test", [Pairs(tuple(rows))])


def _specimen(of_rig: str, planned: str) -> str:
    if of_rig and planned and of_rig != planned:
        return f"{of_rig} by the rig file, {planned} by the plan"
    return said(of_rig or planned)


def _kind(source: RecordSource) -> str:
    header = source.header
    if header.truth is not None:
        return "simulated: no wall was tested"
    if header.origin is not None:
        return f"imported from {header.origin.get('file', 'another program')}"
    if header.kept is not None:
        return "nobody had armed: kept from the ring of the last minutes"
    return "armed and recorded"


def verdict_section(source: RecordSource) -> Section:
    """What the recorder said of the run, and what somebody decided afterwards."""
    quality = source.results.get("quality")
    parts: list[Part] = []
    if isinstance(quality, dict):
        verdict = str(quality.get("verdict", MISSING))
        tones: dict[str, Tone] = {"good": "good", "repeat": "bad", "bad": "bad"}
        parts.append(Words(f"The recorder: {verdict}.", tones.get(verdict, "warning")))
        parts += [Words(f"•  {reason}") for reason in _texts(quality.get("reasons"))]
    else:
        parts.append(Words("The recorder has not judged this run.", "warning"))
    given = source.given
    if given is not None and given.verdict is not None:
        tone: Tone = "good" if given.verdict == "good" else "bad"
        why = f": {given.reason}" if given.reason else ", without a reason"
        parts.append(Words(f"Decided on {moment(given.given_utc)}: {given.verdict}{why}.", tone))
    return Section("2  Verdict", parts)


def _texts(value: object) -> list[str]:
    return [str(item) for item in value] if isinstance(value, list) else []


def plan_section(source: RecordSource) -> Section:
    """The order to arm against what was measured; check and zero."""
    plan = source.header.test_plan
    rows: list[tuple[str, str]] = []
    if plan is None:
        rows.append(("Plan", "none: nobody planned this run"))
    else:
        rows += [
            ("θ0/α planned", _target(source)),
            ("Side planned", true_minus(plan.side) or "either"),
        ]
    analysis = source.results.get("analysis")
    analysis = analysis if isinstance(analysis, dict) else {}
    if source.test is not None:
        side = "+x" if analysis.get("side", 1) == 1 else "−x"
        rows.append(("θ0/α measured", f"{source.test.phi0:.4f} towards {side}"))
    rows += [("Sensor check", _check(source)), ("Zero", _zero(source))]
    parts: list[Part] = [Pairs(tuple(rows))]
    findings = plan.check.findings if plan is not None and plan.check is not None else ()
    if findings:
        cells = tuple((finding.channel or "rig", finding.verdict, finding.text) for finding in findings)
        parts.append(Grid(("Channel", "Check", "Finding"), cells, (1.2, 1.0, 6.0), small=True))
    return Section("3  Plan, check and zero", parts)


def _target(source: RecordSource) -> str:
    plan = source.header.test_plan
    if plan is None or plan.theta0_over_alpha is None or plan.band is None:
        return "no target"
    low, high = plan.band
    return f"{plan.theta0_over_alpha:.4f} ± {100 * plan.tolerance:.1f} % ({low:.4f} to {high:.4f})"


def _check(source: RecordSource) -> str:
    plan = source.header.test_plan
    if plan is None or plan.check is None:
        return "not taken before this test"
    check = plan.check
    overruled = "; armed in spite of it" if check.overruled else ""
    return f"{check.verdict}{overruled}, {moment_of(check.taken_utc)}. {check.summary}".strip()


def _zero(source: RecordSource) -> str:
    record = source.header.tare_record
    if not source.header.tare:
        return "not taken: the analysis takes it from the rest after the test"
    samples = record.get("n_samples")
    over = f" over {samples} samples" if isinstance(samples, int) else ""
    return f"taken{over}, {moment_of(str(record.get('taken_utc', '')))}; by channel in section 8"


def conditions_section(source: RecordSource) -> Section:
    """What somebody wrote down: before the test and during it."""
    header, plan = source.header, source.header.test_plan
    written = list(dict.fromkeys(filter(None, (plan.notes if plan else "", header.notes))))
    rows = [
        ("Conditions", said(plan.conditions if plan else "")),
        ("Notes before", said("\n".join(written))),
    ]
    parts: list[Part] = [Pairs(tuple(rows))]
    typed = [event for event in source.events if event.kind in ("note", "marker")]
    if typed:
        cells = tuple((figure(source.seconds(event.sample), 2), event.kind, event.text) for event in typed)
        parts.append(Grid(("s", "Kind", "Note during the test"), cells, (1.0, 1.0, 7.0)))
    return Section("4  Conditions and notes", parts)


def results_section(source: RecordSource) -> Section:
    """θ0, r by each estimator, the picture, and the half-cycles."""
    test = source.test
    if test is None:
        return Section("5  Results", [Words(f"No result: {source.no_result}", "warning")])
    analysis = source.results.get("analysis")
    rows = [
        ("θ0", f"{figure(1e3 * test.theta0_rad, 2)} mrad, θ0/α = {test.phi0:.4f}"),
        ("θ0 by instruments", _theta0_by_family(analysis)),
        ("Impacts", str(len(test.impacts_s))),
        ("r by all instruments", MISSING if test.verdict is None else verdict_sentence(test.verdict)),
        *(("Doubt about r", reason) for reason in _doubts(test)),
        (
            "Specimen",
            f"α = {test.alpha_rad:.4f} rad, p = {test.p_rad_s:.3f} rad/s, r_max = {test.r_max:.4f} (1.2)",
        ),
    ]
    return Section(
        "5  Results",
        [
            Pairs(tuple(rows)),
            Grid(
                ("Estimator", "r", "Standard error", "r/r_max", "Bias", "Corrected r"),
                tuple(_estimate_rows(test)) or ((("too few impacts for r",) + ("",) * 5),),
                (3.2, 1.0, 1.4, 1.0, 1.0, 1.5),
            ),
            *_families(test),
            record_picture(test),
            Grid(
                ("n", "s after release", "Peak, mrad", "Peak θ/α", "T, s"),
                tuple(_half_cycles(test)),
                (1.0, 2.0, 2.0, 2.0, 2.0),
                small=True,
            ),
        ],
    )


def _families(test: TestSummary) -> list[Part]:
    """What each sensor family says of θ0 and r."""
    rows = tuple(family_rows(test))
    if not rows:
        return []
    return [Grid(HEADINGS, rows, (2.0, 2.0, 2.2, 2.2, 1.0, 1.0, 1.6), small=True), Words(CAPTION)]


def _doubts(test: TestSummary) -> tuple[str, ...]:
    """Why r is not to be believed; none where it is."""
    if test.verdict is None or test.verdict.trust != "doubtful":
        return ()
    return test.verdict.reasons


def _theta0_by_family(analysis: object) -> str:
    families = analysis.get("theta0_by_family") if isinstance(analysis, dict) else None
    if not isinstance(families, dict) or not families:
        return MISSING
    values = [
        f"{_FAMILIES.get(name, name)} {figure(1e3 * family['value'], 2)} {_error_mrad(family)}".strip()
        for name, family in families.items()
        if isinstance(family, dict) and isinstance(family.get("value"), float)
    ]
    return f"{', '.join(values)} mrad"


def _error_mrad(family: Mapping[str, object]) -> str:
    sigma_rad = family.get("sigma")
    return plus_minus(1e3 * sigma_rad if isinstance(sigma_rad, float) else None, 2)


def _estimate_rows(test: TestSummary) -> Iterator[tuple[str, ...]]:
    for name, words in _METHODS.items():
        method = test.methods.get(name)
        if method is not None:
            yield (
                words,
                figure(method.r, 4),
                plus_minus(method.standard_error) or MISSING,
                figure(method.r / test.r_max, 3),
                figure(method.bias, 4),
                figure(method.corrected, 4),
            )


def _half_cycles(test: TestSummary) -> Iterator[tuple[str, ...]]:
    for n, peak in enumerate(test.peaks_rad):
        impact = test.impacts_s[n - 1] if 0 < n <= len(test.impacts_s) else (0.0 if n == 0 else None)
        period = test.periods_s[n - 1] if 0 < n <= len(test.periods_s) else None
        yield (
            "release" if n == 0 else str(n),
            figure(impact, 4),
            figure(1e3 * peak, 3),
            figure(peak / test.alpha_rad, 4),
            figure(period, 4),
        )

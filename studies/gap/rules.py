"""What each rule of the decision is worth: stored answers, concluded anew with one rule switched off.

    python -m studies.gap.rules DIR… --results NAME

Each DIR is a folder of sealed cases with results in DIR/NAME (``daq-app gap blind run DIR --results NAME``)
and labels beside it as DIR-labels. Nothing is fitted: the stored remainder, free forms and probabilities are
judged by another policy. An answer that is then no longer refused is that of the best hypothesis.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from daq_app.gap.blind.names import class_of
from daq_app.gap.blind.running.runner import case_folders, read_outcome
from daq_app.gap.blind.scoring.judge import Judged, judge
from daq_app.gap.blind.scoring.score import by_laboratory
from daq_app.gap.blind.seal import open_label
from daq_app.gap.core.policy import POLICY, Policy
from daq_app.gap.core.result import verdict_of

NEVER = 1e9
"""A limit that nothing reaches."""
COLUMNS = (
    "decisions right",
    "set holds truth",
    "calibration error",
    "AUROC outside",
    "outside",
    "outside blamed",
    "wrong at p > 0.95",
)


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule of the decision and the policy without it."""

    words: str
    policy: Policy = POLICY
    other_forms: bool = True
    """Whether another form of a family is a hypothesis."""
    findings: bool = True
    """Whether what is measured of an instrument and no effect does is something unknown."""


RULES = (
    Rule("nothing"),
    Rule("a share that remains", replace(POLICY, unknown_share=NEVER)),
    Rule("a group that is off by far", replace(POLICY, unknown_misfit=NEVER)),
    Rule("a free form that gains on top", replace(POLICY, form_nats=NEVER)),
    Rule("another form as a hypothesis", other_forms=False),
    Rule("both of these", replace(POLICY, form_nats=NEVER), other_forms=False),
    Rule("what no effect does to an instrument", findings=False),
    Rule("what nobody foresees", replace(POLICY, unforeseen=0.0)),
)


def concluded(result: dict[str, Any], rule: Rule) -> dict[str, Any]:
    """A stored result with the probability of something unknown and the decision without a rule."""
    probes = {name for entry in result["probes"] for name in entry["effects"]}
    entries = [e for e in result["which"] if rule.other_forms or not probes.intersection(e["effects"])]
    total = math.fsum(e["probability"] for e in entries)
    raw = [{**e, "probability": e["probability"] / total if total else 0.0} for e in entries]
    named = [e for e in raw if not probes.intersection(e["effects"])]
    unknown = _unknown(result, named, rule.policy)
    measured = {f["name"] for f in result["findings"]}
    strange = [f for f in result["findings"] if f["material"] and not f["parameter"]]
    another_form = 1.0 - math.fsum(e["probability"] for e in named) >= rule.policy.name_probability
    refused = unknown >= rule.policy.refused or another_form or (rule.findings and bool(strange))
    decision = result["decision"]
    if refused:
        decision = "none_of_these"
    elif decision == "none_of_these":
        decision = _named(named, measured, rule.policy)
    known = (1.0 - unknown) * (1.0 - rule.policy.unforeseen)
    which = [{**e, "probability": known * e["probability"]} for e in raw]
    found = {**result, "which": which, "set95": _set(raw, rule.policy), "decision": decision}
    forms = (e["probability"] for e in which if probes.intersection(e["effects"]))
    return {**found, "p_unknown": min(unknown + math.fsum(forms), 1.0)}


def _unknown(result: dict[str, Any], named: Sequence[dict[str, Any]], policy: Policy) -> float:
    """Probability of something unknown behind what the best hypothesis leaves."""
    rest = result["rest"]
    largest = max((group["discrepancy"] for group in rest["groups"]), default=0.0)
    share = policy.chance(rest["share"], policy.unknown_share)
    known = 1.0 - share * policy.chance(rest["nats"], policy.unknown_nats)
    known *= 1.0 - policy.chance(largest, policy.unknown_misfit)
    gain = max((form["excess"] for form in result["free_forms"]), default=0.0)
    best = named[0]["log_evidence"]
    explained = max(best - next(_nulls(result), best), 0.0)
    return 1.0 - known * (1.0 - policy.chance(gain, max(policy.form_nats, policy.form_share * explained)))


def _nulls(result: dict[str, Any]) -> Iterator[float]:
    """Log evidence of the hypothesis without a cause."""
    measured = {finding["name"] for finding in result["findings"]}
    return (e["log_evidence"] for e in result["which"] if not set(e["effects"]) - measured)


def _named(named: Sequence[dict[str, Any]], measured: set[str], policy: Policy) -> str:
    """The verdict where nothing is refused."""
    classes: dict[tuple[str, ...], float] = {}
    for entry in named:
        key = class_of(tuple(entry["effects"]))
        classes[key] = classes.get(key, 0.0) + entry["probability"]
    best = max(classes, key=lambda key: classes[key])
    if not set(best) - measured:
        return "nothing_missing"
    return verdict_of(len(best)) if classes[best] >= policy.name_probability else "cannot_tell"


def _set(raw: Sequence[dict[str, Any]], policy: Policy) -> list[dict[str, Any]]:
    """The most probable hypotheses until they hold what a set shall hold."""
    kept, total = [], 0.0
    for entry in raw:
        if total >= policy.set_content:
            break
        kept.append(entry)
        total += entry["probability"]
    return kept


def judged(folders: Sequence[Path], results: str) -> list[list[Judged]]:
    """All cases that have a result, judged once for each of `RULES`."""
    found: list[list[Judged]] = [[] for _ in RULES]
    for folder in folders:
        for case in case_folders(folder):
            outcome = read_outcome(folder, case.name, results)
            if outcome is None or not outcome.result:
                continue
            label = open_label(case, folder.with_name(f"{folder.name}-labels") / f"{case.name}.json")
            for row, rule in zip(found, RULES, strict=True):
                row.append(judge(label, replace(outcome, result=concluded(outcome.result, rule))))
    return found


def table(found: Sequence[Sequence[Judged]]) -> str:
    """Markdown: a row for each rule that is switched off."""
    lines = [f"| without | {' | '.join(COLUMNS)} |", "|---" * (len(COLUMNS) + 1) + "|"]
    for rule, cases in zip(RULES, found, strict=True):
        columns = by_laboratory(cases)[-1].columns
        lines.append(f"| {rule.words} | {' | '.join(columns.get(name, '–') for name in COLUMNS)} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=form)
    parser.add_argument("folders", nargs="+", type=Path, metavar="DIR")
    parser.add_argument("--results", required=True, metavar="NAME")
    given = parser.parse_args(arguments)
    print(table(judged(given.folders, given.results)))


if __name__ == "__main__":
    main()

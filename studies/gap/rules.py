"""What each rule of the decision is worth: the same fits, concluded with one rule switched off at a time.

    python -m studies.gap.rules DIR… --out RESULTS

Each DIR is a folder of sealed cases with its labels beside it as DIR-labels (``daq-app gap blind make``).
Every case is fitted once; a rule is switched off when hypotheses are ranked and the answer is given, not
while they are searched. A case that has a file in RESULTS is not fitted again.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from daq_app.config import load_rig
from daq_app.gap.blind.layout import RIG_FILE, run_files
from daq_app.gap.blind.running.runner import Outcome, case_folders
from daq_app.gap.blind.scoring.judge import Judged, judge
from daq_app.gap.blind.scoring.laboratories import by_laboratory
from daq_app.gap.blind.seal import open_label
from daq_app.gap.core import CannotDiagnose, Options
from daq_app.gap.core.diagnose import _Study
from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.fitting.held_out import GapSize
from daq_app.gap.core.fitting.parallel import Workers
from daq_app.gap.core.judging.evidence import Hypothesis
from daq_app.gap.core.judging.joined import with_findings
from daq_app.gap.core.policy import POLICY, Policy
from daq_app.gap.rocking_model.findings import findings_of
from daq_app.gap.rocking_model.records import load_run
from daq_app.gap.rocking_model.study import model_and_library, prepare

NEVER = 1e9
"""A limit that nothing reaches."""


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule of the decision and the policy without it."""

    words: str
    without: Policy
    findings_count: bool = True
    """Whether what no effect does among the findings about instruments counts."""


RULES = (
    Rule("all rules", POLICY),
    Rule("a further cause explains a share or clears", replace(POLICY, further_share=0.0)),
    Rule("… or clears what it improves", replace(POLICY, further_leaves=-1.0)),
    Rule("a weak cause stands where nothing is excluded", replace(POLICY, null_excluded=0.0)),
    Rule("a weak cause is told beside an unlikely null", replace(POLICY, null_probability=0.0)),
    Rule("a share that remains", replace(POLICY, unknown_share=NEVER)),
    Rule("a group that is off by far", replace(POLICY, unknown_misfit=NEVER)),
    Rule("a free form gains on top", replace(POLICY, form_nats=NEVER)),
    Rule("another form is a hypothesis", replace(POLICY, prior_other_form=1e-12)),
    Rule("findings that no effect does", POLICY, findings_count=False),
)
COLUMNS = (
    "decisions right",
    "first right ≥ 4 sd",
    "set holds truth",
    "calibration error",
    "AUROC outside",
    "outside blamed",
    "wrong at p > 0.95",
)


class _OnceHeldOut(_Study):
    """A study that holds runs out once for each answer: no rule changes what a hypothesis predicts."""

    held_out: dict[Hypothesis, tuple[GapSize | None, dict[str, float]]] | None = None

    def _held_out(self, best: Hypothesis) -> tuple[GapSize | None, dict[str, float]]:
        self.held_out = self.held_out or {}
        if best not in self.held_out:
            self.held_out[best] = super()._held_out(best)
        return self.held_out[best]


def conclusions(case: Path) -> list[dict[str, Any]]:
    """The results of a case, one for each of `RULES`."""
    rig = load_rig(case / RIG_FILE)
    runs, limits = prepare([load_run(path, rig) for path in run_files(case)])
    model, library = model_and_library(runs)
    experiment, options = Experiment.of(model, runs), Options()
    findings = findings_of(runs)
    results = []
    with Workers(experiment, options.workers) as workers:
        study = _OnceHeldOut(experiment, library, options, workers)
        study.fit_all()
        for rule in RULES:
            study.policy = rule.without
            seen = findings if rule.findings_count else [replace(f, unknown=0.0) for f in findings]
            result = with_findings(study.conclude(list(limits)), seen, rule.without)
            results.append(result.to_dict())
    return results


def judged(folders: Sequence[Path], out: Path) -> list[list[Judged]]:
    """All cases, judged once for each of `RULES`; a case that is refused counts as one that says nothing."""
    found: list[list[Judged]] = [[] for _ in RULES]
    for folder in folders:
        for case in case_folders(folder):
            kept = out / folder.name / f"{case.name}.json"
            if not kept.exists():
                kept.parent.mkdir(parents=True, exist_ok=True)
                try:
                    results: list[dict[str, Any]] = conclusions(case)
                except CannotDiagnose:
                    results = [{} for _ in RULES]
                kept.write_text(json.dumps(results), encoding="utf-8")
            label = open_label(case, folder.with_name(f"{folder.name}-labels") / f"{case.name}.json")
            for row, result in zip(found, json.loads(kept.read_text(encoding="utf-8")), strict=True):
                row.append(judge(label, Outcome(case.name, "", "", 0.0, result or None)))
    return found


def table(found: Sequence[Sequence[Judged]]) -> str:
    """Markdown: a row for each rule that is switched off."""
    lines = [f"| without | {' | '.join(COLUMNS)} |", "|---" * (len(COLUMNS) + 1) + "|"]
    for rule, cases in zip(RULES, found, strict=True):
        columns = by_laboratory(cases)[-1].columns
        words = "nothing: all rules" if rule is RULES[0] else rule.words
        lines.append(f"| {words} | {' | '.join(columns.get(name, '–') for name in COLUMNS)} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", nargs="+", type=Path, metavar="DIR")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args(arguments)
    print(table(judged(given.folders, given.out)))


if __name__ == "__main__":
    main()

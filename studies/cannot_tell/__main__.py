"""When the diagnosis cannot tell A from B and names a measurement: does that measurement resolve it?

    python -m studies.cannot_tell [CASE …] [--seed S] [--again] [--page PAGE.md]

A wall with effect A is simulated by the blind check's generator (`daq_app.gap.blind.world`, which shares
nothing with the diagnosis), and diagnosed from little: one level, no LVDTs, a short record. Then what the
library names as telling A from B is added for the same wall and the same sensors, and it is diagnosed again.
One JSON per case and seed; those that exist are not done again.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from daq_app.gap.core import CannotDiagnose, Diagnosis, Options
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.study import diagnose_runs
from studies.cannot_tell.cases import CASES, Case
from studies.cannot_tell.measured import diagnose_with
from studies.cannot_tell.page import page
from studies.cannot_tell.wall import part_of, simulate
from studies.gap.rows import Found, cpu_s, run_study

FOLDER = Path("build/gap_cannot_tell")


def study(name: str, seed: int, cores: int) -> Found:
    """Both diagnoses of one case; everything that the table needs."""
    case, began = CASES[name], cpu_s()
    runs = simulate(case.truth, case.everything, seed)
    options = Options(workers=cores)
    little = part_of(runs, case.everything, case.little)
    first = second = _answer(lambda: diagnose_runs(little, options))
    if first["set95"] != [[case.name]]:
        second = _answer(lambda: _again(case, part_of(runs, case.everything, case.more), seed, options))
    return {
        "case": name,
        "truth": case.name,
        "parameters": case.truth.parameters,
        "little": case.before,
        "added": case.added,
        "first": first,
        "second": second,
        "cpu_s": cpu_s() - began,
    }


def _again(case: Case, runs: list[GapRun], seed: int, options: Options) -> Diagnosis:
    """With what was added: runs, channels, or the reading of an instrument, which has its own error."""
    if case.instrument is None:
        return diagnose_runs(runs, options)
    error = float(case.instrument.sd * np.random.default_rng([seed, 23]).standard_normal())
    return diagnose_with(runs, case.instrument, case.reading + error, options)


def _answer(ask: Callable[[], Diagnosis]) -> dict[str, Any]:
    """What is kept of a diagnosis; a refusal is an answer too."""
    try:
        result = ask().to_dict()
    except CannotDiagnose as refusal:
        return {"decision": "refused", "sentence": str(refusal), "set95": [], "next": "", "top": []}
    return {
        "decision": result["decision"],
        "sentence": result["decision_detail"]["sentence"],
        "set95": [r["effects"] for r in result["set95"]],
        "next": result["next_measurement"],
        "top": [[r["effects"], r["probability"]] for r in result["which"][:6]],
        "unknown": result["p_unknown"],
    }


def _say(found: Found) -> str:
    words = [
        f"{which}: {found[which]['decision']} {found[which]['top'][:3]}" for which in ("first", "second")
    ]
    return " | ".join(words) + f" ({found['cpu_s']:.0f} s)"


def main(arguments: list[str] | None = None) -> int:
    """Run what is missing, then write the page."""
    return run_study(__doc__ or "", list(CASES), study, _say, page, FOLDER, arguments)


if __name__ == "__main__":
    sys.exit(main())

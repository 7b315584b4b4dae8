"""The independently simulated recordings as runs of the diagnosis.

``python -m tests.support.gap.foreign_cases case_001 …`` prints what is said about them (all effects), with
``--only EFFECT,EFFECT`` what is said when only these are considered, with ``--folder`` those of another
folder.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from daq_app.gap.rocking_model.records import GapRun, Sensor, Survey

FOLDER = Path(__file__).parents[3].parent / "shared" / "data" / "independent"
_KINDS: dict[str, tuple[Any, float]] = {
    "LVDT": ("lvdt", 1e-3),
    "WIREPOT": ("wire", 1e-3),
    "ACCEL": ("accelerometer", 1.0),
    "TILT": ("tiltmeter", math.pi / 180),
}


def load_case(name: str, cases: Path = FOLDER) -> list[GapRun]:
    """All runs of one case of a folder of cases, in SI."""
    folder = cases / name
    case = json.loads((folder / "case.json").read_text(encoding="utf-8"))
    body = case["specimen"]
    p = math.sqrt(body["weight_N"] * body["R0_m"] / body["inertia_about_base_corner_kgm2"])
    survey = Survey(body["name"], body["alpha0_rad"], p, body["base_width_m"] / 2, body["height_m"])
    factors = np.array([_KINDS[c["kind"]][1] for c in case["channels"]])
    sensors = tuple(_sensor(c) for c in case["channels"])
    runs = []
    for entry in case["runs"]:
        stored = np.load(folder / entry["npz"])
        data = stored["data"] * stored["scale"][:, None] + stored["offset"][:, None]
        runs.append(
            GapRun(entry["id"], entry["level"], float(stored["fs"]), sensors, data * factors[:, None], survey)
        )
    return runs


def _sensor(channel: dict[str, Any]) -> Sensor:
    family, factor = _KINDS[channel["kind"]]
    anchor = channel.get("anchor_m")
    return Sensor(
        channel["name"],
        family,
        tuple(channel["position_m"]),
        tuple(anchor) if anchor else None,
        channel.get("axis", "z" if family == "lvdt" else "x"),
        (channel["range"][0] * factor, channel["range"][1] * factor),
        time_constant_s=channel.get("time_constant_s", 0.0),
        ac_coupled="AC coupled" in channel.get("measures", ""),
    )


def main() -> None:
    """Print a line per case: verdict, the first three hypotheses, the effect's parameters, the gap."""
    from daq_app.gap.rocking_model.study import diagnose_runs

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="+")
    parser.add_argument("--only", default="")
    parser.add_argument("--folder", type=Path, default=FOLDER)
    given = parser.parse_args()
    for case in given.cases:
        result = diagnose_runs(load_case(case, given.folder), only=tuple(filter(None, given.only.split(","))))
        first = ", ".join(
            f"{' + '.join(r.effects) or 'nothing'} {r.probability:.3f}" for r in result.which[:3]
        )
        values = ", ".join(
            f"{e.name} {e.value:.5g} ({e.low:.5g} … {e.high:.5g})" for e in result.effect_parameters
        )
        gap = f"{result.gap.before:.2f} → {result.gap.after:.2f}" if result.gap else ""
        print(
            f"{case}: {result.decision.verdict}; {first}; {values}; {gap}; {result.rest.words}",
            flush=True,
        )


if __name__ == "__main__":
    main()

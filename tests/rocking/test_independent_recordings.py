"""Recordings of the same kind of rig from another engine and another sensor chain, with their truth.

Two of the labelled cases move as Housner's block does: one without any effect, one whose LVDTs and
other families lag. r, θ0 and the times must come out of both, though nothing here was tuned to them.
"""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from daq_app.config import load_rig
from daq_app.rocking import AnalysisOptions, TestRecord, analyse_record

TO_SI = {"mm": 1e-3, "m/s2": 1.0, "m/s²": 1.0, "deg": math.pi / 180.0}
FAMILIES = {"LVDT": "lvdt", "WIREPOT": "wire", "ACCEL": "accelerometer", "TILT": "tiltmeter"}


def rig_of(case, configs):
    """The shipped rig with the sensors where the case has them."""
    rig = load_rig(configs / f"{case['specimen']['name'].lower()}.toml")
    channels = []
    for entry in case["channels"]:
        family = next(
            ours for theirs, ours in FAMILIES.items() if entry["kind"].upper().startswith(theirs[:4])
        )
        unit = TO_SI[entry["unit"]]
        model = rig.of_family(family)[0]
        changes = {
            "id": entry["name"],
            "position_m": tuple(entry["position_m"]),
            "range_si": tuple(value * unit for value in entry["range"]),
        }
        if family == "wire":
            changes["anchor_m"] = tuple(entry.get("anchor_m") or entry["anchor"])
        if family == "tiltmeter":
            changes["axis"] = entry["name"][-1].lower()
        channels.append(model.model_copy(update=changes))
    return rig.model_copy(update={"channels": tuple(channels)})


def record_of(folder, run, rig):
    with np.load(folder / run["npz"]) as file:
        scale = file["scale"] * [TO_SI[str(unit)] for unit in file["units"]]
        offset = file["offset"] * [TO_SI[str(unit)] for unit in file["units"]]
        si = file["data"] * scale[:, None] + offset[:, None]
        return TestRecord.from_array(
            rig, float(file["fs"]), si, channel_ids=[str(name) for name in file["names"]], tared=False
        )


@pytest.mark.parametrize("name", ["case_003", "case_004"])
def test_r_of_housner_walls_that_somebody_else_simulated(shared_data, configs, name):
    folder = shared_data / "independent" / name
    case = json.loads((folder / "case.json").read_text(encoding="utf-8"))
    label = json.loads((folder.parent / "labels.json").read_text(encoding="utf-8"))[name]
    body = label["true_body"]
    r_max = 1.0 - 2.0 * body["m"] * body["R"] ** 2 * math.sin(body["alpha"]) ** 2 / body["IO"]
    rig = rig_of(case, configs)
    for run, truth in zip(case["runs"], label["runs"], strict=True):
        analysis = analyse_record(record_of(folder, run, rig), AnalysisOptions(bias_runs=0))
        tolerance = 0.01 if run["level"] == "L1" else 0.003
        for method in ("eav", "crt"):
            assert analysis.estimates[method].r == pytest.approx(truth["r_factor"] * r_max, abs=tolerance)
        fit = analysis.fit
        assert fit.p_rad_s == pytest.approx(body["p"], rel=0.005)
        small = 2.0 * fit.sigma_alpha_rad if run["level"] == "L1" else 0.0
        assert fit.alpha_rad == pytest.approx(body["alpha"], abs=max(0.005 * body["alpha"], small))
        assert analysis.theta0_rad == pytest.approx(truth["theta0"], abs=0.005 * body["alpha"])
        assert analysis.release_s == pytest.approx(truth["release_time_s"], abs=2e-3)
        assert analysis.found and math.isfinite(analysis.rest_s)

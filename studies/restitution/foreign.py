"""Recordings of a laboratory and an engine that are not ours, as tests that faults can be put into."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from daq_app.config import Rig, load_rig
from daq_app.config.rig import Channel, Family, Specimen
from daq_app.rocking.theory.block import STANDARD_GRAVITY_M_S2, RigidBlock
from studies.restitution.laboratory import LaboratoryTest

_TO_SI: Final = {"mm": 1e-3, "m/s2": 1.0, "m/s²": 1.0, "deg": math.pi / 180.0}
_FAMILIES: Final[dict[str, Family]] = {
    "LVDT": "lvdt",
    "WIREPOT": "wire",
    "ACCEL": "accelerometer",
    "TILT": "tiltmeter",
}


def foreign_tests(folder: Path, configs: Path, names: tuple[str, ...] = ()) -> Iterator[LaboratoryTest]:
    """Every recording of the cases `names` of a folder of labelled cases (of all if none is named)."""
    labels = json.loads((folder / "labels.json").read_text(encoding="utf-8"))
    for name in names or sorted(labels):
        case = json.loads((folder / name / "case.json").read_text(encoding="utf-8"))
        rig = rig_of(case, configs)
        for entry, run in zip(case["runs"], labels[name]["runs"], strict=True):
            truth = _truth(labels[name], run)
            yield _test(folder / name / entry["npz"], rig, truth)


def rig_of(case: Mapping[str, Any], configs: Path) -> Rig:
    """The shipped rig of the specimen, or FR1's with the case's own; sensors are where the case has them."""
    shipped = configs / f"{case['specimen']['name'].lower()}.toml"
    if shipped.exists():
        rig = load_rig(shipped)
    else:
        rig = load_rig(configs / "fr1.toml")
        rig = rig.model_copy(update={"specimen": _specimen(rig.specimen, case["specimen"])})
    return rig.model_copy(update={"channels": tuple(_channel(rig, entry) for entry in case["channels"])})


def _specimen(shipped: Specimen, entry: Mapping[str, Any]) -> Specimen:
    changes = {
        "name": entry["name"],
        "weight_n": entry["weight_N"],
        "height_m": entry["height_m"],
        "length_m": entry["length_m"],
        "rotational_inertia_kg_m2": entry["inertia_about_base_corner_kgm2"],
        "r0_m": entry["R0_m"],
        "alpha0_rad": entry["alpha0_rad"],
        "p_rad_s": entry["p_rad_s"],
    }
    return shipped.model_copy(update=changes)


def _channel(rig: Rig, entry: Mapping[str, Any]) -> Channel:
    (family,) = (ours for theirs, ours in _FAMILIES.items() if entry["kind"].startswith(theirs))
    unit = _TO_SI[entry["unit"]]
    changes: dict[str, Any] = {
        "id": entry["name"],
        "position_m": tuple(entry["position_m"]),
        "range_si": tuple(value * unit for value in entry["range"]),
    }
    if family == "wire":
        changes["anchor_m"] = tuple(entry["anchor_m"])
    if family == "tiltmeter":
        changes["axis"] = entry["name"][-1].lower()
    return rig.of_family(family)[0].model_copy(update=changes)


def _truth(label: Mapping[str, Any], run: Mapping[str, Any]) -> dict[str, Any]:
    """The label's `r`, or `r_factor`: the share of the upper bound of a block on the points that the wall
    turns about. Labels with neither have θ0, and `_truth_of_block`.
    """
    if "r" not in label and "r_factor" not in run:
        # A wall that sways is let go from its first peak; it was held at θ0 on the average.
        let_go_rad = math.copysign(run["peaks"][0], run["theta0"]) if "peaks" in run else run["theta0"]
        return {"theta0_rad": let_go_rad, **_truth_of_block(label)}
    body = label["true_body"]
    block = RigidBlock(body["m"] * STANDARD_GRAVITY_M_S2, body["R"], body["IO"], body["alpha"])
    inset = sum(effect["params"].get("inset", 0.0) for effect in label["effects"])
    pivoted = block.with_pivots_inside(inset)
    return {
        "restitution": label["r"] if "r" in label else run["r_factor"] * pivoted.r_max,
        "theta0_rad": run["theta0"],
        "alpha_rad": pivoted.alpha0_rad,
        "p_rad_s": pivoted.p_rad_s,
    }


def _truth_of_block(label: Mapping[str, Any]) -> dict[str, float]:
    """α and p of a body that is given by them, and the r that its impacts were drawn about.

    No α and p where an effect on the wall makes it turn about other points, and NaN for r where impacts came
    out of contacts and not of an r that was asked for.
    """
    body = label["true_body"]
    drawn_r = "r_intended" in body and body["r_contact"] is None
    truth = {"restitution": body["r_intended"] if drawn_r else math.nan}
    if "p" in body and all(effect["where"] != "wall" for effect in label["effects"]):
        truth |= {"alpha_rad": body["alpha"], "p_rad_s": body["p"]}
    return truth


def _test(path: Path, rig: Rig, truth: dict[str, Any]) -> LaboratoryTest:
    with np.load(path) as stored:
        units = np.array([_TO_SI[str(unit)] for unit in stored["units"]])
        scale, offset = stored["scale"] * units, stored["offset"] * units
        si = stored["data"] * scale[:, None] + offset[:, None]
        rows = [list(map(str, stored["names"])).index(channel_id) for channel_id in rig.channel_ids]
        return LaboratoryTest(rig, float(stored["fs"]), si[rows], {}, truth)

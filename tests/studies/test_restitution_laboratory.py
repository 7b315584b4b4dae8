"""Laboratories drawn for the study of r: a seed names one test."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from daq_app.config import load_rig, plan_tasks
from studies.restitution import laboratory
from studies.restitution.foreign import foreign_tests, rig_of
from studies.restitution.laboratory import draw_test

ROOT = Path(__file__).parents[2]
DRAWN = """
from daq_app.config import load_rig
from studies.restitution.laboratory import draw_test
test = draw_test(load_rig("configs/fr1.toml"), 5000)
print([float(value) for value in test.si.std(axis=1).round(9)])
"""


def test_a_seed_draws_the_same_test_in_every_process():
    elsewhere = subprocess.run(
        [sys.executable, "-c", DRAWN],
        cwd=ROOT,
        env=os.environ | {"PYTHONHASHSEED": "1"},
        capture_output=True,
        text=True,
        check=True,
    )

    here = draw_test(load_rig(ROOT / "configs" / "fr1.toml"), 5000)

    assert elsewhere.stdout.strip() == str([float(value) for value in here.si.std(axis=1).round(9)])


@pytest.fixture(scope="module")
def rig():
    return load_rig(ROOT / "configs" / "fr1.toml")


def test_a_level_takes_the_place_of_the_drawn_one_and_changes_nothing_else(rig):
    drawn, low, high = (draw_test(rig, 5000, level=level).truth for level in (None, 0.2, 0.4))

    assert abs(low["theta0_rad"]) == pytest.approx(0.2 * low["alpha_rad"], rel=0.03)
    assert high["theta0_rad"] == pytest.approx(2.0 * low["theta0_rad"], rel=1e-3)
    assert np.sign(low["theta0_rad"]) == np.sign(drawn["theta0_rad"])
    assert low["restitution"] == high["restitution"] == drawn["restitution"]


def test_a_case_of_a_wall_that_is_not_shipped_has_its_own_survey(rig):
    wall = {
        "name": "Kufstein-D15",
        "weight_N": 36250.0,
        "height_m": 2.601,
        "length_m": 1.282,
        "inertia_about_base_corner_kgm2": 9207.0,
        "R0_m": 1.3772,
        "p_rad_s": 2.3286,
        "alpha0_rad": 0.20299,
    }
    lvdt = {"name": "LV-1", "kind": "LVDT", "unit": "mm", "position_m": [-0.28, 0.1, 0.05], "range": [-5, 70]}
    theirs = rig_of({"specimen": wall, "channels": [lvdt]}, ROOT / "configs")
    ours = rig_of({"specimen": {"name": "FR1"}, "channels": [lvdt]}, ROOT / "configs")

    assert (theirs.specimen.name, theirs.specimen.r0_m) == ("Kufstein-D15", 1.3772)
    assert theirs.channel("LV-1").range_si == pytest.approx((-0.005, 0.07))
    assert ours.specimen == rig.specimen


BODY = {"alpha": 0.2, "p": 2.3, "r_intended": 0.9, "r_contact": None}


@pytest.mark.parametrize(
    ("where", "r_contact", "told", "r"),
    [
        ("wires", None, {"alpha_rad": 0.2, "p_rad_s": 2.3}, 0.9),
        ("wires", 0.92, {"alpha_rad": 0.2, "p_rad_s": 2.3}, math.nan),
        ("wall", None, {}, 0.9),
    ],
)
def test_a_label_tells_alpha_and_p_of_a_wall_without_an_effect_and_r_that_was_drawn(
    tmp_path, rig, where, r_contact, told, r
):
    label = {
        "effects": [{"where": where}],
        "true_body": BODY | {"r_contact": r_contact},
        "runs": [{"theta0": 0.05}],
    }
    wire = rig.of_family("wire")[0]
    channel = {"name": "WP-1", "kind": "WIREPOT", "unit": "mm", "position_m": wire.position_m}
    channel |= {"range": [-500, 500], "anchor_m": wire.anchor_m}
    case = {"specimen": {"name": "FR1"}, "channels": [channel], "runs": [{"npz": "run.npz"}]}
    (tmp_path / "case_1").mkdir()
    (tmp_path / "labels.json").write_text(json.dumps({"case_1": label}))
    (tmp_path / "case_1" / "case.json").write_text(json.dumps(case))
    one = np.ones(1)
    np.savez(
        tmp_path / "case_1" / "run.npz",
        data=np.zeros((1, 4)), scale=one, offset=0.0 * one, names=["WP-1"], units=["mm"], fs=4000.0,
    )  # fmt: skip

    (test,) = foreign_tests(tmp_path, ROOT / "configs")

    truth = dict(test.truth)
    assert truth.pop("restitution") == pytest.approx(r, nan_ok=True)
    assert truth == {"theta0_rad": 0.05, **told}


@pytest.mark.parametrize("other", [["--foreign", "nowhere"], ["--ringing"]])
def test_a_level_beside_what_has_its_own_is_refused(other):
    command = [sys.executable, "-m", "studies.restitution", "faults", "--level", "0.2", *other]
    told = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)

    assert told.returncode == 2 and "--level goes with" in told.stderr


def test_a_family_has_one_time_base_that_is_off_by_microseconds(rig):
    planned = {c.channel.id: c.time_offset_s for task in plan_tasks(rig).tasks for c in task.channels}

    told = draw_test(rig, 5000).offsets_s

    for family in ("wire", "lvdt", "accelerometer"):
        off_s = [told[channel.id] - planned[channel.id] for channel in rig.of_family(family)]
        assert np.ptp(off_s) < 1e-12
        assert 0.0 < abs(off_s[0]) < 2e-4


@pytest.mark.parametrize("further_m", [0.002, -0.002])
def test_faces_are_drawn_further_apart_and_nearer(rig, further_m):
    drawn = laboratory._on_faces(rig, further_m)

    def distance_m(of):
        return np.ptp([channel.position_m[0] for channel in of.of_family("lvdt")])

    assert distance_m(drawn) - distance_m(rig) == pytest.approx(further_m)


def test_all_heights_of_wires_are_off_by_one_datum(rig, monkeypatch):
    nominal = draw_test(rig, 5000)
    monkeypatch.setattr(laboratory, "_DATUM_SIGMA_M", 0.1)

    elsewhere = draw_test(rig, 5000)

    def reach(test, family):
        return np.ptp(test.si[test.rows(family)], axis=1)

    levers_m = [channel.position_m[2] for channel in rig.of_family("wire")]
    raised_m = (reach(elsewhere, "wire") / reach(nominal, "wire") - 1.0) * levers_m
    assert np.all(np.abs(raised_m) > 5e-3)
    assert np.ptp(raised_m) < 0.2 * np.abs(raised_m).mean()
    np.testing.assert_allclose(reach(elsewhere, "lvdt"), reach(nominal, "lvdt"), rtol=1e-3)

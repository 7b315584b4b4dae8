"""The score itself: planted lies, and an honest diagnosis, each score as they deserve."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq_app.gap.blind.layout import SEAL_FILE
from daq_app.gap.blind.making.mix import category_of
from daq_app.gap.blind.names import COMPARABLE, accepted_names, base_name, class_of, comparable
from daq_app.gap.blind.running.runner import Outcome, save_outcome
from daq_app.gap.blind.scoring.judge import Judged, judge
from daq_app.gap.blind.scoring.report import write_markdown, write_report
from daq_app.gap.blind.scoring.score import (
    Row,
    Score,
    by_laboratory,
    claims,
    confusion,
    score_folder,
    table,
)
from daq_app.gap.blind.seal import SealBroken, read_seal, seal_case
from daq_app.gap.blind.world.effects.catalogue import ENTRIES, LIBRARY, OUTSIDE
from daq_app.gap.rocking_model.library import rocking_library
from daq_app.runfile.digest import file_sha256

Answer = Callable[[dict[str, Any], np.random.Generator], dict[str, Any]]
N = 200


def labels() -> list[dict[str, Any]]:
    rng = np.random.default_rng(0)
    return [_label(k, rng) for k in range(N)]


def _label(index: int, rng: np.random.Generator) -> dict[str, Any]:
    category = category_of(1, index)
    names = {
        "single": lambda: [LIBRARY[index % len(LIBRARY)]],
        "pair": lambda: ["viscous", "gain"] if index % 2 else ["winkler", "hum"],
        "outside": lambda: [OUTSIDE[index % len(OUTSIDE)]],
        "null": list,
    }[category]()
    effects = [
        {
            "name": name,
            "family": ENTRIES[name].family,
            "accept": list(accepted_names(name)),
            "parameters": {ENTRIES[name].parameter: ENTRIES[name].low},
        }
        for name in names
    ]
    seen = [float(rng.uniform(5, 100)) for _ in names]
    return {"case": f"case_{index + 1:04d}", "category": category, "effects": effects, "detectability": seen}


def claim(names: list[str], probability: float, decision: str = "", **more: Any) -> dict[str, Any]:
    family = " + ".join(dict.fromkeys(ENTRIES[base_name(name)].family for name in names)) or "none"
    first = {"effects": names, "family": family, "probability": probability}
    by_number = {0: "nothing_missing", 1: "effect", 2: "pair"}
    return {
        "which": [first],
        "set95": [first],
        "decision": decision or by_number[len(names)],
        "gap": {"before": 9.0, "after": 1.02, "floor": 1.0, "closure": 0.99},
        **more,
    }


def perfect(label: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    if label["category"] == "outside":
        return claim(["viscous"], 0.5, "none_of_these")
    names = [effect["name"] for effect in label["effects"]]
    number = int(label["case"].removeprefix("case_"))
    # A 95 % set that always held the truth would be too wide, and so would such an interval.
    if label["category"] in ("pair", "null") and number % 8 == 0:
        return claim(["polarity"] if names != ["polarity"] else ["swap"], 0.3, "cannot_tell")
    width = 0.005 if number % 15 == 1 else 0.1
    parameters = [
        {
            "name": f"{e['name']}.{COMPARABLE.get(e['name'], key)}",
            "value": 1.01 * value,
            "low": 1.01 * value - width * abs(value),
            "high": 1.01 * value + width * abs(value),
        }
        for e in label["effects"]
        for key, value in ((k, comparable(e["name"], v)) for k, v in e["parameters"].items())
    ]
    return claim(names, 0.97, effect_parameters=parameters)


def test_a_clock_is_compared_as_the_design_counts_it() -> None:
    """4266.67 Hz taken for 4000 Hz: a rate 1/15 too high, and a time between samples that is 1/16 shorter."""
    assert comparable("clock", 1.0 / 15.0) == pytest.approx(-1.0 / 16.0)
    assert comparable("viscous", 0.01) == 0.01


def always_viscous(label: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    return claim(["viscous"], 0.9)


def overconfident(label: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """Right two times in three, and sure of it each time."""
    names = [effect["name"] for effect in label["effects"]]
    if label["category"] != "outside" and rng.uniform() < 0.67:
        return claim(names, 0.99)
    return claim(["swap" if names != ["swap"] else "hum"], 0.99)


def scored(answer: Answer) -> tuple[dict[str, Row], list[Judged]]:
    rng = np.random.default_rng(1)
    judged = [
        judge(label, Outcome(label["case"], "test", "", 1.0, json.loads(json.dumps(answer(label, rng)))))
        for label in labels()
    ]
    return {row.name: row for row in table(judged)}, judged


def missed(rows: dict[str, Row]) -> set[str]:
    return {name for name, row in rows.items() if row.met is False}


def test_a_perfect_diagnosis_meets_every_target() -> None:
    rows, judged = scored(perfect)
    assert missed(rows) == set()
    assert rows["outside the library: AUROC"].found.value == 1.0
    assert rows["parameter error, median"].found.value == pytest.approx(0.01, abs=1e-6)
    assert rows["95 % set holds the truth"].found.n == 160
    assert Score(tuple(rows.values()), tuple(judged), ()).passed is True


def test_always_viscous_scores_what_guessing_deserves() -> None:
    rows, judged = scored(always_viscous)
    assert rows["first answer right, effect ≥ 4 sd"].found.value < 0.06
    assert rows["pairs exact"].found.value == 0.0
    assert rows["nothing hidden, yet blamed on an effect"].found.value == 1.0
    assert rows["outside, blamed on an effect as decided"].found.value == 1.0
    assert rows["expected calibration error"].found.value > 0.8
    assert rows["outside the library: AUROC"].found.value == pytest.approx(0.5)
    assert {"first answer right, effect ≥ 4 sd", "pairs exact"} <= missed(rows)
    assert {answer for _, answer in confusion(judged)} == {"viscous"}


def test_overconfidence_shows_in_calibration_and_not_in_the_right_answers_alone() -> None:
    rows, _ = scored(overconfident)
    assert 0.5 < rows["first answer right, effect ≥ 4 sd"].found.value < 0.8
    assert rows["expected calibration error"].found.value > 0.3
    assert rows["wrong at p > 0.95"].found.value > 0.3
    assert {"expected calibration error", "wrong at p > 0.95"} <= missed(rows)


def test_peeking_at_the_hashes_gains_nothing(tmp_path: Path) -> None:
    """A diagnosis that tries every label it can think of against the published hash only guesses."""

    def peek(folder: Path) -> str:
        seal = read_seal(folder)
        for name in LIBRARY:
            guess = json.dumps({"effects": [{"name": name}]}, sort_keys=True, ensure_ascii=False)
            for salt in (b"", folder.name.encode()):
                if hashlib.sha256(salt + guess.encode()).hexdigest() == seal["label_sha256"]:
                    return name
        digits = int(seal["label_sha256"], 16)  # what is left: to make something of the digits
        return LIBRARY[digits % len(LIBRARY)]

    right = 0
    for index, name in enumerate(LIBRARY * 3):
        folder = tmp_path / f"case_{index:04d}"
        folder.mkdir()
        seal_case(folder, {"effects": [{"name": name}]}, tmp_path / "labels" / f"{index}.json")
        right += peek(folder) == name
    assert right <= 0.12 * 3 * len(LIBRARY)  # chance is 1 in 37


def test_a_pair_half_found_is_not_exact_and_a_synonym_is() -> None:
    pair = next(label for label in labels() if [e["name"] for e in label["effects"]] == ["viscous", "gain"])
    half = judge(pair, Outcome("c", "t", "", 1.0, claim(["viscous"], 0.9)))
    whole = judge(pair, Outcome("c", "t", "", 1.0, claim(["gain@WP-1", "viscous"], 0.9)))
    assert (half.first_right, whole.first_right, whole.family_right) == (False, True, True)
    tilt = next(label for label in labels() if label["category"] == "single")
    tilt = {
        **tilt,
        "effects": [{**tilt["effects"][0], "name": "base_tilt", "accept": accepted_names("base_tilt")}],
    }
    assert judge(tilt, Outcome("c", "t", "", 1.0, claim(["eccentric_mass"], 0.9))).first_right


def test_forms_that_no_sensor_tells_apart_are_one_answer() -> None:
    """Their probabilities add up and they count once in the set, by the scorer's classes alone."""
    label = next(label for label in labels() if label["category"] == "single")
    effect = {**label["effects"][0], "name": "base_tilt", "accept": accepted_names("base_tilt")}
    tilt = {**label, "effects": [effect]}
    split = [("viscous", 0.38), ("base_tilt", 0.32), ("eccentric_mass", 0.30)]
    which = [{"effects": [name], "family": "geometry", "probability": p} for name, p in split]
    told = judge(tilt, Outcome("c", "t", "", 1.0, {"which": which, "set95": which, "decision": "effect"}))
    assert told.first_right
    assert told.named == ("base_tilt",)
    assert told.claimed == pytest.approx(0.62)
    assert told.set_size == 2
    # Whatever a diagnosis thinks alike: a lag of one wire is not that of another.
    wires = [{"effects": [f"lag@WP-{k}"], "family": "sensor", "probability": 0.5} for k in (1, 2)]
    other = judge(tilt, Outcome("c", "t", "", 1.0, {"which": wires, "set95": wires, "decision": "effect"}))
    assert (other.set_size, other.claimed) == (2, 0.5)


@pytest.mark.parametrize(("tau_s", "covered"), [(0.04, True), (0.08, False)])
def test_a_slow_release_is_compared_by_the_mean_time_of_its_force(tau_s: float, covered: bool) -> None:
    """A force that has fallen evenly to nothing after 80 ms acts for 40 ms in the mean."""
    effect = {"name": "slow_release", "family": "release", "accept": ["slow_release"]}
    label = {
        "case": "case_0001",
        "category": "single",
        "effects": [effect | {"parameters": {"tau_s": 0.08}}],
        "detectability": [50.0],
    }
    found = {"name": "slow_release.tau", "value": tau_s, "low": 0.95 * tau_s, "high": 1.05 * tau_s}
    answer = claim(["slow_release"], 0.97, "effect", effect_parameters=[found])
    judged = judge(label, Outcome("case_0001", "test", "", 1.0, answer))
    assert judged.parameter_covered is covered
    assert judged.parameter_error == pytest.approx(0.0 if covered else 1.0)


def test_what_the_diagnosis_calls_alike_the_scorer_does_too() -> None:
    for group in rocking_library({"WP-1": "wire"}).groups:
        assert len({class_of([name]) for name in group.names}) == 1


def judged_with(
    truth: list[str], answer: dict[str, Any], category: str = "", strength: float = 9.0
) -> Judged:
    """A diagnosis of a case that hides `truth`, each effect of this many sd."""
    label = {
        "case": "c",
        "category": ("null", "single", "pair", "triple")[len(truth)],
        "effects": [
            {
                "name": n,
                "family": ENTRIES[n].family,
                "accept": list(accepted_names(n)),
                "parameters": {"x": 1.0},
            }
            for n in truth
        ],
        "detectability": [strength for _ in truth],
    }
    return judge(label, Outcome("c", "d", "s", 1.0, answer))


HUM = {"name": "hum@wire", "material": True}


def test_what_is_measured_about_an_instrument_is_no_cause() -> None:
    for truth in ([], ["viscous"]):
        answer = claim([*truth, "hum@wire"], 0.99, "pair" if truth else "effect", findings=[HUM])
        assert judged_with(truth, answer).answered_rightly
    assert not judged_with([], claim(["viscous", "hum@wire"], 0.99, "pair", findings=[HUM])).answered_rightly


def test_a_hidden_fault_that_was_measured_is_right_if_it_belongs_into_the_answer() -> None:
    assert judged_with(["hum"], claim(["hum@wire"], 0.99, "effect", findings=[HUM])).answered_rightly
    listed = claim([], 0.99, "nothing_missing", findings=[{**HUM, "material": False}])
    assert not judged_with(["hum"], listed).answered_rightly
    both = claim(["hum@wire", "viscous"], 0.99, "pair", findings=[HUM])
    assert judged_with(["viscous", "hum"], both).exact
    assert not judged_with(["hum"], both).answered_rightly


def test_a_decision_that_names_less_than_its_first_hypothesis_is_judged_by_what_it_names() -> None:
    """A slip was measured, and what fits best beside it is below detection."""
    slip = {"name": "sliding@base", "material": True}
    decided = {"verdict": "effect", "effects": ["sliding@base"], "family": "contact"}
    both = claim(["sliding@base", "viscous"], 0.7, "effect", findings=[slip], decision_detail=decided)
    alone = judged_with(["sliding"], both)
    assert alone.answered_rightly
    assert not alone.first_right
    assert not judged_with(["sliding", "viscous"], both).answered_rightly


def test_a_measured_fault_that_no_effect_does_is_right_and_claims_no_probability() -> None:
    """ "None of these, spikes were measured" gives next to nothing to the hypotheses, and is right."""
    spikes = {"name": "spikes@lvdt", "material": True}
    found = judged_with(["spikes"], claim([], 0.0, "none_of_these", findings=[spikes]))
    assert found.answered_rightly
    assert claims([found]) == ([], [])
    assert claims([judged_with(["hum"], claim(["hum@wire"], 0.9, findings=[HUM]))]) == ([0.9], [True])


def test_three_effects_are_right_in_any_order_and_only_together() -> None:
    truth = ["viscous", "gain", "base_tilt"]
    assert judged_with(truth, claim(["gain@WP-1", "eccentric_mass", "viscous"], 0.9, "several")).exact
    assert not judged_with(truth, claim(["gain@WP-1", "viscous"], 0.9, "pair")).exact


def test_below_detection_is_right_for_what_cannot_be_seen_and_for_nothing_else() -> None:
    answer = claim([], 0.6, "below_detection")
    assert judged_with(["viscous"], answer, strength=2.0).answered_rightly
    assert not judged_with(["viscous"], answer, strength=12.0).answered_rightly


def test_laboratories_have_a_row_each_and_one_together() -> None:
    right = judged_with(["viscous"], claim(["viscous"], 0.99, "effect"))
    wrong = replace(judged_with(["viscous"], claim(["coulomb"], 0.99, "effect")), laboratory="rough")
    rows = {row.laboratory: row for row in by_laboratory([right, wrong])}
    assert list(rows) == ["own", "rough", "all"]
    assert [rows[name].columns["singles"] for name in rows] == ["1/1", "0/1", "1/2"]
    assert rows["rough"].columns["wrong at p > 0.95"] == "1/1"


def test_cannot_tell_is_right_only_with_the_truth_in_the_set_and_a_measurement() -> None:
    label = next(label for label in labels() if label["category"] == "single")
    name = label["effects"][0]["name"]
    unsure = claim([name], 0.5, "cannot_tell")
    assert not judge(label, Outcome("c", "t", "", 1.0, unsure)).answered_rightly
    unsure["next_measurement"] = "a tiltmeter on the base"
    assert judge(label, Outcome("c", "t", "", 1.0, unsure)).answered_rightly
    unsure["set95"] = []
    assert not judge(label, Outcome("c", "t", "", 1.0, unsure)).answered_rightly


def test_an_effect_that_the_diagnosis_does_know_is_not_outside() -> None:
    label = next(label for label in labels() if label["category"] == "outside")
    name = label["effects"][0]["name"]
    known = judge(label, Outcome("c", "t", "", 1.0, claim([name], 0.99)))
    assert known.known and known.answered_rightly


def test_a_failed_diagnosis_counts_against_it() -> None:
    judged = [judge(label, Outcome(label["case"], "t", "", 1.0, None, "broke")) for label in labels()]
    rows = {row.name: row for row in table(judged)}
    assert rows["no result"].met is False
    assert rows["first answer right, effect ≥ 4 sd"].found.value == 0.0


@pytest.fixture
def check(tmp_path: Path) -> Path:
    """A folder of twenty sealed cases with perfect results."""
    folder, rng = tmp_path / "check", np.random.default_rng(1)
    for label in labels()[:20]:
        case = folder / label["case"]
        case.mkdir(parents=True)
        (case / "rig.toml").write_text(label["case"], encoding="utf-8")
        seal_case(case, label, tmp_path / "labels" / f"{case.name}.json")
        sealed = file_sha256(case / SEAL_FILE)
        save_outcome(folder, Outcome(case.name, "test", sealed, 1.0, perfect(label, rng)))
    return folder


def test_a_folder_is_scored_and_shown(check: Path, tmp_path: Path) -> None:
    found = score_folder(check, tmp_path / "labels")
    assert len(found.judged) == 20 and not found.waiting
    json.dumps(found.to_dict(), allow_nan=False)
    write_report(found, tmp_path / "score.html")
    page = (tmp_path / "score.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 3
    assert "Confusion matrix" in page and "20 cases" in page
    write_markdown(found, tmp_path / "score.md")
    text = (tmp_path / "score.md").read_text(encoding="utf-8")
    assert "| pairs exact | 1 |" in text and "images/score-reliability.png" in text
    assert (tmp_path / "images" / "score-confusion.png").read_bytes().startswith(b"\x89PNG")


def test_a_result_for_other_data_and_a_changed_label_are_refused(check: Path, tmp_path: Path) -> None:
    kept = tmp_path / "labels" / "case_0003.json"
    text = kept.read_text(encoding="utf-8")
    kept.write_text(text.replace("single", "null").replace("pair", "null"), encoding="utf-8")
    if kept.read_text(encoding="utf-8") != text:
        with pytest.raises(SealBroken, match="case_0003"):
            score_folder(check, tmp_path / "labels")
    kept.write_text(text, encoding="utf-8")
    seal_case(check / "case_0003", json.loads(json.loads(text)["label"]), kept)
    with pytest.raises(SealBroken, match="belongs to other data"):
        score_folder(check, tmp_path / "labels")


def test_cases_without_a_result_are_named_and_their_labels_stay_sealed(check: Path, tmp_path: Path) -> None:
    (check / "results" / "case_0007.json").unlink()
    (tmp_path / "labels" / "case_0007.json").write_text("whoever opens this fails", encoding="utf-8")
    found = score_folder(check, tmp_path / "labels")
    assert found.waiting == ("case_0007",) and not found.passed

"""Diagnosis of recordings from another engine and another sensor chain (five labelled cases)."""

from __future__ import annotations

import json

import pytest

from daq_app.gap.core import Diagnosis, Options, fit
from daq_app.gap.core.policy import POLICY
from daq_app.gap.rocking_model.prediction.model import RockingModel
from daq_app.gap.rocking_model.study import diagnose_runs, prepare
from tests.support.gap.foreign_cases import FOLDER, load_case

pytestmark = pytest.mark.skipif(
    not FOLDER.is_dir(), reason="the folder shared/data/independent is not beside the repository"
)


def _body(case: str) -> dict[str, float]:
    body: dict[str, float] = json.loads((FOLDER / "labels.json").read_text(encoding="utf-8"))[case][
        "true_body"
    ]
    return body


def test_parameters_of_a_wall_that_lacks_nothing_are_found() -> None:
    """Another engine's wall: α and p to a few tenths of a per cent, though the survey is off by 1 %."""
    runs, _ = prepare(load_case("case_003"))
    found = fit(RockingModel(runs[0].survey), runs)
    true = _body("case_003")
    assert found.values["alpha"][0] == pytest.approx(true["alpha"], rel=3e-3)
    assert found.values["p"][0] == pytest.approx(true["p"], rel=3e-3)
    assert found.values["half_base"][0] == pytest.approx(true["b"] / 2, rel=2e-3)
    assert found.values["mount_height"][0] == pytest.approx(0.0, abs=0.006), (
        "LVDTs act 50 mm above the joint, and the file says so"
    )
    assert found.sigmas["scatter of times"] < 1e-4


def _diagnose(case: str) -> Diagnosis:
    return diagnose_runs(load_case(case), Options(causes=1))


@pytest.mark.heavy
@pytest.mark.timeout(600)
def test_dry_friction_of_a_foreign_wall_is_named() -> None:
    result = _diagnose("case_001")
    assert result.which[0].effects == ("coulomb",)
    known = 1.0 - POLICY.unforeseen
    assert result.which[0].probability > 0.95 * known
    assert result.which[1].effects == ("free_dissipation",), "the rest is a friction that goes otherwise"
    assert result.which[0].probability + result.which[1].probability > 0.999 * known
    assert result.gap is not None
    assert result.gap.closure > 0.95


@pytest.mark.heavy
@pytest.mark.timeout(600)
def test_foreign_null_case_is_blamed_on_nothing() -> None:
    assert _diagnose("case_003").decision.verdict in ("parameters", "nothing_missing")


@pytest.mark.heavy
@pytest.mark.timeout(600)
def test_foreign_lag_is_named_with_its_size() -> None:
    result = _diagnose("case_004")
    assert result.which[0].effects == ("lag@lvdt",)
    assert result.decision.verdict == "effect", result.rest.words
    estimate = result.effect_parameters[0]
    assert estimate.low < 5.197e-3 < estimate.high


@pytest.mark.heavy
@pytest.mark.timeout(600)
def test_foreign_soft_joint_is_named_with_its_size() -> None:
    result = _diagnose("case_005")
    assert result.which[0].effects == ("winkler",)
    estimate = result.effect_parameters[0]
    assert estimate.low < 0.1079e-3 < estimate.high, "from the label's stiffness, weight and base"


@pytest.mark.heavy
@pytest.mark.timeout(600)
def test_two_foreign_causes_at_once_are_not_taken_for_one() -> None:
    """A tilted base and contact springs; no single effect may be named as the cause."""
    verdict = diagnose_runs(load_case("case_002")).decision.verdict
    assert verdict not in ("effect", "nothing_missing", "parameters")

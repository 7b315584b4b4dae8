"""Verdicts of the core on a toy whose truth is known: named, null, unknown form, interrupted, refused."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.core import CannotDiagnose, Confusion, Library, Options, diagnose, fit
from daq_app.gap.core.fitting.parallel import Interrupted
from tests.support.gap.toy_wave import LIBRARY, DecayModel, make_runs

FAST = Options()


def test_present_effect_is_named_and_closes_the_gap() -> None:
    result = diagnose(DecayModel(), make_runs(0, slope_k=0.05), LIBRARY, FAST)
    assert result.decision.verdict == "effect"
    assert result.which[0].effects == ("slope",)
    estimate = result.effect_parameters[0]
    assert estimate.low < 0.05 < estimate.high
    assert result.gap is not None
    assert result.gap.after < 1.25 < result.gap.before
    assert result.gap.closure > 0.8
    assert "peak of rotation" in result.where.sentence


def test_weak_effect_is_not_blamed_on_runs_that_lack_nothing() -> None:
    blamed = [
        seed
        for seed in range(10)
        if diagnose(DecayModel(), make_runs(seed), LIBRARY, FAST).decision.verdict
        in ("effect", "pair", "none_of_these")
    ]
    assert len(blamed) <= 1, f"null cases blamed: {blamed}"


def test_scatter_is_not_mistaken_for_physics() -> None:
    """The prototype's lesson: without scatter in the likelihood every null case was blamed on something."""
    verdicts = [
        diagnose(DecayModel(), make_runs(seed, scatter=0.012), LIBRARY, FAST).decision.verdict
        for seed in range(6)
    ]
    assert not {"effect", "pair"} & set(verdicts), verdicts


def test_unknown_form_of_a_known_family_is_called_so() -> None:
    result = diagnose(DecayModel(), make_runs(2, scatter=0.002, step_h=0.05), LIBRARY, FAST)
    assert result.decision.verdict == "none_of_these"
    assert result.decision.family == "loss"
    assert result.decision.effects == ()
    shape = [value for value, _, _ in result.probe_shapes["free"].values()]
    assert shape[3] - shape[1] > 0.02, "more r above an amplitude of a half than below"


def test_a_form_that_comes_near_is_not_named_where_a_free_form_gains_on_top_of_it() -> None:
    """The gate sees nothing and the free form alone is little better: a score test on top is sharper."""
    runs = make_runs(2, scatter=0.002, step_h=0.0153)
    near = diagnose(DecayModel(), runs, LIBRARY, FAST)
    assert (near.decision.verdict, near.decision.family) == ("none_of_these", "loss")
    assert "slope comes near" in near.decision.sentence
    without = diagnose(DecayModel(), runs, LIBRARY.without("free"), FAST)
    assert without.decision.effects == ("slope",)
    for seed in range(4):
        true = diagnose(DecayModel(), make_runs(seed, scatter=0.002, slope_k=0.03), LIBRARY, FAST)
        assert true.decision.effects == ("slope",), seed


def test_an_effect_of_every_run_is_as_strong_as_all_runs_together_make_it() -> None:
    """Six runs at four sd each cannot be chance; six at one sd each are."""
    found = fit(DecayModel(), make_runs(0), (LIBRARY["kick"],))
    own = [k for k, (key, _) in enumerate(found.keys) if key == "kick.j"]
    assert len(own) == 6
    for each, together in ((4.0, 8.77), (1.0, 0.80)):
        found.u[own], found.covariance = each, np.eye(len(found.u))
        assert found.strength("kick") == pytest.approx(together, abs=0.01)
    found.u[own] = 50.0
    assert found.strength("kick") == pytest.approx(50.0 * 6**0.5, rel=0.01), (
        "where the chance is not a number"
    )


def test_pair_is_found_where_a_single_effect_leaves_structure() -> None:
    result = diagnose(DecayModel(), make_runs(4, slope_k=0.05, shift_s=0.05), LIBRARY, Options())
    assert result.decision.verdict == "pair"
    assert set(result.which[0].effects) == {"slope", "shift"}


class Twins(DecayModel):
    """The slope a second time under another name."""

    def predict(self, run, values):  # type: ignore[no-untyped-def]
        merged = dict(values)
        merged["slope.k"] = merged.get("slope.k", 0.0) + merged.pop("twin.k", 0.0)
        return super().predict(run, merged)


TWINS = Library(
    [
        replace(LIBRARY["slope"], confusable_with=(Confusion("twin", "Fit a torque sensor at the hinge."),)),
        replace(LIBRARY["slope"], name="twin", confusable_with=()),
        LIBRARY["shift"],
    ]
)


def test_twins_cannot_be_told_apart_and_the_measurement_is_named() -> None:
    result = diagnose(Twins(), make_runs(0, slope_k=0.05), TWINS, FAST)
    assert result.decision.verdict == "cannot_tell"
    assert ".." not in result.decision.sentence
    assert {h.effects for h in result.set95} == {("slope",), ("twin",)}
    assert "torque sensor" in result.next_measurement


def test_what_is_there_and_has_two_names_is_not_below_detection_though_each_is_weak() -> None:
    """One of the two it is, at 3.5 sd and with nothing missing at 3 %; at 3.3 sd nothing may be missing."""
    seen = diagnose(Twins(), make_runs(2, slope_k=0.009), TWINS, FAST)
    found = {entry.effects: entry.probability for entry in seen.which}
    assert 1e-3 < found[()] < 0.05
    assert seen.decision.verdict == "cannot_tell"
    assert "torque sensor" in seen.next_measurement
    assert diagnose(Twins(), make_runs(0, slope_k=0.01), TWINS, FAST).decision.verdict == "below_detection"


def test_other_parameter_values_are_not_called_physics() -> None:
    runs = make_runs(11)
    result = diagnose(DecayModel(), runs, LIBRARY, FAST)
    assert result.decision.verdict in ("parameters", "nothing_missing")


def test_one_run_is_a_stated_limit() -> None:
    result = diagnose(DecayModel(), make_runs(0, count=1), LIBRARY, FAST)
    assert result.gap is None
    assert any("One run only" in limit for limit in result.limits)


def test_no_run_is_refused_in_words() -> None:
    with pytest.raises(CannotDiagnose, match="no run"):
        diagnose(DecayModel(), [], LIBRARY, FAST)


def test_json_is_complete_and_plain() -> None:
    result = diagnose(DecayModel(), make_runs(0, slope_k=0.05), LIBRARY, FAST)
    data = json.loads(result.to_json())
    for key in ("where", "which", "set95", "decision", "parameters", "gap", "next_measurement", "format"):
        assert key in data
    assert data["decision"] == "effect"
    assert data["which"][0] == {
        "effects": ["slope"],
        "family": "loss",
        "probability": pytest.approx(result.which[0].probability),
        "log_evidence": pytest.approx(result.which[0].log_evidence),
    }


def test_diagnosis_stops_when_told() -> None:
    asked = iter([False, True])
    with pytest.raises(Interrupted):
        diagnose(DecayModel(), make_runs(0), LIBRARY, Options(cancelled=lambda: next(asked, True)))


def test_several_processes_give_the_same_answer() -> None:
    runs = make_runs(0, slope_k=0.05)
    alone = diagnose(DecayModel(), runs, LIBRARY, FAST)
    together = diagnose(DecayModel(), runs, LIBRARY, Options(workers=2))
    assert together.which[0].log_evidence == pytest.approx(alone.which[0].log_evidence, abs=1e-6)
    assert together.decision.verdict == alone.decision.verdict

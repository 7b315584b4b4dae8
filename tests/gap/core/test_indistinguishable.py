"""Effects that no sensor tells apart: one answer, whose forms are all said."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from daq_app.gap.core import Confusion, Effect, Indistinguishable, Library, Options, diagnose
from daq_app.gap.core.judging.evidence import Ranked, answers, credible_set, log_prior
from daq_app.gap.core.parameters import signed
from daq_app.gap.core.policy import POLICY
from daq_app.gap.rocking_model.library import rocking_library
from tests.support.gap.toy_wave import LIBRARY, DecayModel, make_runs

SLOPE = Effect(
    "slope",
    "loss",
    (signed("k", 0.1),),
    "r + k (a − ½)",
    "test",
    confusable_with=(Confusion("twin", "nothing of use"),),
)
TWIN = Effect("twin", "loss", (signed("k", 0.1),), "same", "test")
SAME = Indistinguishable(("slope", "twin"), "the same equation", "a torque sensor at the hinge")
EFFECTS = (SLOPE, TWIN, LIBRARY["shift"])


class Twins(DecayModel):
    """`twin` does what `slope` does."""

    def predict(self, run, values):  # type: ignore[no-untyped-def]
        merged = dict(values)
        merged["slope.k"] = merged.get("slope.k", 0.0) + merged.pop("twin.k", 0.0)
        return super().predict(run, merged)


def test_twins_that_no_sensor_tells_apart_are_an_answer_with_both_names() -> None:
    result = diagnose(Twins(), make_runs(0, slope_k=0.05), Library(EFFECTS, (SAME,)), Options(causes=1))
    assert result.decision.verdict == "effect"
    assert {result.decision.effects, *result.decision.alternatives} == {("slope",), ("twin",)}
    assert result.decision.confidence > 0.9 > result.which[0].probability
    assert "slope or twin" in result.decision.sentence or "twin or slope" in result.decision.sentence
    assert "torque sensor" in result.next_measurement
    assert {h.effects for h in result.set95} == {("slope",), ("twin",)}
    detail = result.to_dict()["decision_detail"]
    assert detail["alternatives"] == [list(names) for names in result.decision.alternatives]


def test_what_has_two_names_is_no_likelier_than_with_one() -> None:
    """Twins share the prior probability that one of them would have alone; the other family keeps its own."""
    twins, alone = Library(EFFECTS, (SAME,)), Library((replace(SLOPE, confusable_with=()), LIBRARY["shift"]))

    def prior(name: str, library: Library) -> float:
        return math.exp(log_prior((name,), library, POLICY))

    assert prior("slope", twins) == prior("twin", twins) == pytest.approx(0.5 * prior("slope", alone))
    assert prior("shift", twins) == pytest.approx(prior("shift", alone))


def test_a_pair_of_which_one_is_a_twin_is_named_as_a_pair() -> None:
    runs = make_runs(4, slope_k=0.05, shift_s=0.05)
    result = diagnose(Twins(), runs, Library(EFFECTS, (SAME,)), Options())
    assert result.decision.verdict == "pair"
    assert {result.decision.effects, *result.decision.alternatives} == {
        ("shift", "slope"),
        ("shift", "twin"),
    }
    assert "which no sensor here tells apart" in result.decision.sentence


def test_the_set_holds_classes_and_the_likeliest_class_comes_first() -> None:
    library = Library(EFFECTS, (SAME,))
    ranked = [
        Ranked(("shift",), "stiffness", 0.4, 0.0),
        Ranked(("slope",), "loss", 0.3, 0.0),
        Ranked(("twin",), "loss", 0.27, 0.0),
        Ranked((), "none", 0.03, 0.0),
    ]
    found = answers(ranked, library)
    assert [a.effects for a in found] == [("slope",), ("shift",), ()]
    assert found[0].probability == pytest.approx(0.57)
    assert [a.effects for a in credible_set(found)] == [("slope",), ("shift",)]


def test_indistinguishable_effects_must_be_there_and_in_one_group_only() -> None:
    with pytest.raises(ValueError, match="kick is in a group of indistinguishable"):
        Library(EFFECTS, (Indistinguishable(("slope", "kick"), "", ""),))
    with pytest.raises(ValueError, match="slope is in a group of indistinguishable"):
        Library(EFFECTS, (SAME, Indistinguishable(("slope", "shift"), "", "")))
    assert Library(EFFECTS, (SAME,)).without("twin").groups == ()


def test_only_what_levels_and_sensors_cannot_separate_is_indistinguishable() -> None:
    library = rocking_library({"WP-1": "wire"})
    assert library.class_of(["eccentric_mass", "viscous"]) == ("base_tilt", "viscous")
    assert library.class_of(["filter_delay@WP-1"]) == ("lag@WP-1",)
    for name in ("pivot_shift", "rounded_edge", "dwell", "bounce", "slow_response@wire"):
        assert library.indistinguishable_from(name) is None

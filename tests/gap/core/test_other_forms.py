"""Another form of the family: how sure a name may be while its form does not show."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from scipy.stats import norm

from daq_app.gap.core import Confusion, Diagnosis, Library, Options, diagnose
from daq_app.gap.core.effects import Effect
from daq_app.gap.core.fitting.screen import Score
from daq_app.gap.core.judging.evidence import Ranked
from daq_app.gap.core.judging.other_forms import FreeForm, with_other_forms
from daq_app.gap.core.policy import POLICY, Policy
from tests.support.gap.toy_wave import BEND, LIBRARY, BendingModel, make_runs

SIZED = replace(BEND, typical=1.5)
"""A bend of 1.5 k (a − ½)² turns the slope over by half of it from one end to the other."""
MORE = "release from more levels"
PROBE = replace(LIBRARY["free"], confusable_with=(Confusion("slope", MORE),))
KNOWN = 1.0 - POLICY.unforeseen
FORMS = Library([*(e for e in LIBRARY.values() if e.name != "free"), PROBE, SIZED])


def diagnosed(seed: int, library: Library = FORMS, policy: Policy = POLICY, **hidden: float) -> Diagnosis:
    options = Options(policy=policy)
    return diagnose(BendingModel(), make_runs(seed, scatter=0.004, **hidden), library, options)


def test_an_effect_that_is_only_just_there_may_have_another_form() -> None:
    """The same runs: named for certain without the departure, which no r(a) of 6 sd deserves."""
    weak = diagnosed(3, policy=replace(POLICY, prior_other_form=0.5), slope_k=0.015)
    assert diagnosed(3, LIBRARY, slope_k=0.015).decision.confidence > 0.99 * KNOWN
    assert 0.9 * KNOWN < diagnosed(3, slope_k=0.015).decision.confidence < 0.95 * KNOWN
    shared = {entry.effects: entry.probability for entry in weak.which}
    assert 0.1 < shared[("free",)] < 0.6
    assert weak.p_unknown == pytest.approx(weak.rest.unknown + shared[("free",)])
    assert weak.decision.verdict == "cannot_tell"
    assert weak.decision.family == "loss"
    assert "slope from another form of loss" in weak.decision.sentence
    assert MORE in weak.next_measurement
    assert weak.best == ("slope",)
    assert weak.in_words(("free", "kick")) == "another form of loss + kick"
    assert {estimate.name for estimate in weak.effect_parameters} == {"slope.k"}


def test_an_effect_whose_form_shows_is_named() -> None:
    strong = diagnosed(2, slope_k=0.3)
    assert strong.decision.verdict == "effect"
    assert strong.decision.effects == ("slope",)
    shared = {entry.effects: entry.probability for entry in strong.which}
    assert 0.0 < shared[("free",)] < 0.06
    assert math.fsum(shared.values()) == pytest.approx(KNOWN * (1.0 - strong.rest.unknown))


def test_another_form_that_is_far_more_likely_is_the_answer() -> None:
    bent = diagnosed(0, slope_k=0.1, bend_c=-0.25)
    assert (bent.decision.verdict, bent.decision.family) == ("none_of_these", "loss")
    assert bent.which[0].effects == ("free",)
    assert bent.best == ("slope",)
    assert bent.rest.unknown > 0.5 > diagnosed(0, slope_k=0.1).rest.unknown


def _form(coefficient: float, error: float, strength: float = 1.0) -> FreeForm:
    return FreeForm.of(SIZED, Score(1.0, 1.0, coefficient, error), strength)


def test_evidence_for_another_form_is_that_of_a_coefficient_of_its_size() -> None:
    own, other = math.hypot(1.0, POLICY.own_form * 3.0), math.hypot(1.0, 1.5)
    named = norm.pdf(2.0, 0.0, own)
    elsewhere = 0.5 * (norm.pdf(2.0, -3.0, other) + norm.pdf(2.0, 3.0, other))
    assert _form(2.0, 1.0, -2.0).log_bayes == pytest.approx(math.log(elsewhere / named))
    assert _form(0.0, 1e3).log_bayes == pytest.approx(0.0, abs=1e-3), "what cannot be seen says nothing"
    small = [_form(0.02 * 1.5, error).log_bayes for error in (1.0, 0.3, 0.05, 1e-6)]
    assert small == sorted(small, reverse=True)
    assert -5.0 < small[-1] < -4.0, "no surer of its form than our model of it is good"
    assert math.isnan(FreeForm.of(BEND, Score(1.0, 1.0, 2.0, 1.0), 1.0).log_bayes), "its size is not known"
    assert math.isnan(FreeForm.of(PROBE, Score(1.0, 3.0), 1.0).log_bayes)


def test_a_departure_of_known_direction_is_no_other_form_the_other_way() -> None:
    directed = replace(SIZED, directed=True)
    along, against = (FreeForm.of(directed, Score(1.0, 1.0, c, 0.3), 1.0).log_bayes for c in (1.5, -1.5))
    assert along == pytest.approx(_form(1.5, 0.3).log_bayes + math.log(2.0), abs=0.01)
    assert against < _form(-1.5, 0.3).log_bayes - 3.0
    assert FreeForm.of(directed, Score(1.0, 1.0, -1.5, 0.3), -1.0).log_bayes == pytest.approx(along)


def test_of_a_pair_the_effect_with_another_form_is_exchanged_and_all_else_gives_way() -> None:
    ranked = [
        Ranked(("kick", "slope"), "release + loss", 0.8, -10.0),
        Ranked(("slope",), "loss", 0.2, -12.0),
    ]
    forms = [_form(1.5, 0.5), _form(0.5, 0.5), FreeForm("free", "loss", "", 1.0, 0.5, 0.0)]
    found = {r.effects: r for r in with_other_forms(ranked, ("kick", "slope"), forms, FORMS, 0.5)}
    factor = 0.5 * (math.exp(forms[0].log_bayes) + math.exp(forms[1].log_bayes))
    total = 1.0 + 0.8 * 0.5 * factor
    assert found["free", "kick"].probability == pytest.approx(0.8 * 0.5 * factor / total)
    assert found["free", "kick"].log_evidence == pytest.approx(-10.0 + math.log(factor))
    assert found["kick", "slope"].probability == pytest.approx(0.8 / total)
    assert found["slope",].probability == pytest.approx(0.2 / total)
    assert with_other_forms(ranked, ("kick", "slope"), forms[2:], FORMS, 0.5) == ranked


def test_a_departure_of_a_family_without_a_probe_stands_for_nothing() -> None:
    library: Library = FORMS.without("free")
    assert isinstance(library["slope"], Effect)
    ranked = [Ranked(("slope",), "loss", 1.0, -10.0)]
    assert with_other_forms(ranked, ("slope",), [_form(3.0, 0.5)], library, 0.5) == ranked

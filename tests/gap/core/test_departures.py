"""Departures from the form of a named effect: tested on top of it, never in its place."""

from __future__ import annotations

import pytest

from daq_app.gap.core import Effect, Library, Options, diagnose, fit
from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.fitting.screen import Base, Score
from daq_app.gap.core.judging.other_forms import FreeForm
from daq_app.gap.core.parameters import signed
from tests.support.gap.toy_wave import AGAIN, BEND, LIBRARY, BendingModel, DecayModel, make_runs


def test_a_departure_from_the_form_of_the_named_effect_is_another_form_of_its_family() -> None:
    """Where r is bent the straight form is named only if nobody asks for others."""
    model, library = BendingModel(), Library([*LIBRARY.values(), BEND])
    runs = make_runs(3, scatter=0.002, slope_k=0.03, bend_c=0.08)
    near = diagnose(model, runs, library, Options())
    assert (near.decision.verdict, near.decision.family) == ("none_of_these", "loss")
    assert "slope comes near" in near.decision.sentence
    assert not {"bend"} & {name for hypothesis in near.which for name in hypothesis.effects}
    assert diagnose(model, runs, LIBRARY.without("free"), Options()).decision.effects == ("slope",)
    for seed in range(4):
        true = diagnose(model, make_runs(seed, scatter=0.002, slope_k=0.03), library, Options())
        assert true.decision.effects == ("slope",), seed


def test_the_named_effect_once_more_gains_nothing_however_unlikely_its_strength_is() -> None:
    """A prior that would have the slope weaker must not speak for another form: three sd from none, and the
    same again beside it would halve what that costs."""
    model, runs = BendingModel(), make_runs(1, slope_k=0.15)
    found = fit(model, runs, (LIBRARY["slope"],))
    assert found.u[found.keys.index(("slope.k", None))] > 2.5
    base = Base(Experiment.of(model, runs), (LIBRARY["slope"],), found, found.columns)
    again = base.score(AGAIN)
    assert again.gain < 0.01
    assert again.determined < 0.01


def test_a_coefficient_that_may_only_be_negative_gains_nothing_where_it_would_be_positive() -> None:
    runs = make_runs(1, slope_k=0.05)
    found = fit(DecayModel(), runs)
    base = Base(Experiment.of(DecayModel(), runs), (), found, found.columns)
    gains = []
    for low, high in ((-1.0, 0.0), (0.0, 1.0)):
        one = signed("k", 0.1)
        object.__setattr__(one, "low", low)
        object.__setattr__(one, "high", high)
        form = Effect("slope", "loss", (one,), "one-sided", "test")
        gains.append(base.score(form).gain)
    assert gains[0] == 0.0
    assert gains[1] > 5.0


def test_an_effect_is_screened_beside_a_cause_from_where_it_led_on_nothing() -> None:
    runs = make_runs(1, slope_k=0.05)
    found = fit(DecayModel(), runs)
    base = Base(Experiment.of(DecayModel(), runs), (), found, found.columns)
    free = base.screened(LIBRARY["slope"])
    begun = base.screened(LIBRARY["slope"], free.starts)
    assert 1 <= len(free.starts) <= 2
    assert begun.robust.gain == pytest.approx(free.robust.gain, rel=1e-12)
    assert begun.strict.gain == pytest.approx(free.strict.gain, rel=1e-12)
    elsewhere = base.screened(LIBRARY["slope"], [free.starts[0] + 1.0])
    assert elsewhere.starts[0] == pytest.approx(free.starts[0] + 1.0)


def test_what_chance_gives_is_no_gain() -> None:
    form = FreeForm.of(BEND, Score(4.0, 1.0))
    assert form.p_value == pytest.approx(0.004678, rel=1e-3), "χ² of 8 with one degree of freedom"
    assert form.excess == pytest.approx(3.0)


def test_a_library_knows_what_its_departures_depart_from() -> None:
    library = Library([*LIBRARY.values(), BEND])
    assert library.departures(("slope", "kick")) == (BEND,)
    assert not library.departures(("kick",))
    assert BEND not in library.named
    assert BEND not in library.probes
    assert "bend" not in library.without("slope"), "it goes with the effect"
    with pytest.raises(ValueError, match="departs from"):
        Library([BEND])

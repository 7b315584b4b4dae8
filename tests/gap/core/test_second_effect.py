"""Effects too weak to be any, and second effects that hide under a first."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from daq_app.gap.core import Effect, Library, Options, Parameter, Prediction, Run, diagnose, fit
from daq_app.gap.core.judging.evidence import strength
from daq_app.gap.core.parameters import between, positive, signed
from tests.support.gap.toy_wave import LIBRARY, PEAKS, DecayModel, make_runs


class Line:
    """Nothing but one strength: features = b x."""

    name = "line"
    scatters = ()
    nuisance = ()

    def local_nuisance(self, run: object) -> tuple[Parameter, ...]:
        return ()

    def predict(self, run: object, values: dict[str, float]) -> Prediction:
        return Prediction(values.get("tilt.b", 0.0) * np.linspace(0, 1, 2 * PEAKS))


@pytest.mark.parametrize("make", [positive, signed])
@pytest.mark.parametrize("true", [0.0, 0.15, 0.3, 1.0])
def test_evidence_counts_only_strengths_that_are_an_effect(make, true: float) -> None:  # type: ignore[no-untyped-def]
    """Against quadrature of likelihood times the prior that has nothing below the smallest strength."""
    rng = np.random.default_rng(3)
    x, sd = np.linspace(0, 1, 2 * PEAKS), 0.2
    run = make_runs(1, count=1)[0]
    values = true * x + sd * rng.normal(size=x.size)
    run = replace(run, features=replace(run.features, values=values, sd=np.full(x.size, sd)))
    strength = replace(make("b", 1.0), smallest=0.2)
    effect = Effect("tilt", "line", (strength,), "b x", "test")
    found = fit(Line(), [run], (effect,))  # type: ignore[arg-type]
    error = sd * np.sqrt(1.0 + np.repeat(found.sizes.discrepancy, PEAKS))
    cost = float(np.log1p(found.sizes.discrepancy).sum())

    def weighed(b: float) -> float:
        likelihood = np.exp(norm.logpdf(values, b * x, error).sum() - found.log_likelihood)
        return float(likelihood * norm.pdf(b, 0.0, strength.sd))

    pieces = [(0.2, 6.0)] if strength.low == 0.0 else [(-6.0, -0.2), (0.2, 6.0)]
    mass = sum(norm.cdf(high, 0, strength.sd) - norm.cdf(low, 0, strength.sd) for low, high in pieces)
    exact = np.log(sum(quad(weighed, low, high, limit=200, points=[true])[0] for low, high in pieces) / mass)
    weight = run.features.independent_fraction
    assert weight == 1.0
    assert found.log_evidence - found.log_likelihood + cost == pytest.approx(exact, abs=0.02)


def test_a_strength_without_a_zero_has_no_smallest() -> None:
    with pytest.raises(ValueError, match="smallest"):
        Parameter("t", 1.0, 1.0, low=0.1, scale="log", smallest=0.2)


def test_a_bias_far_below_its_range_is_no_effect() -> None:
    """Eight posterior sd of a change that is a twentieth of what counts: parameters, not physics."""
    runs = make_runs(2, shift_s=0.005)
    assert diagnose(DecayModel(), runs, LIBRARY, Options()).which[0].effects == ("shift",)
    shift = LIBRARY["shift"]
    least = replace(shift, parameters=(replace(shift.parameters[0], smallest=0.02),))
    others = [effect for effect in LIBRARY.values() if effect.name != "shift"]
    result = diagnose(DecayModel(), runs, Library([*others, least]), Options())
    assert "shift" not in result.which[0].effects


def test_no_second_effect_where_there_is_none() -> None:
    for seed in range(4):
        result = diagnose(DecayModel(), make_runs(seed, shift_s=0.05), LIBRARY, Options())
        assert result.decision.verdict == "effect"
        assert result.which[0].effects == ("shift",)


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_the_form_of_an_effect_is_not_its_strength(scale: str) -> None:
    """A force that falls half evenly is no weaker a release: the form's prior has its centre there."""
    own = between("s", 0.005, 0.2, "s") if scale == "log" else LIBRARY["shift"].parameters[0]
    form = Parameter("even", 0.5, 0.4, "1", 0.0, 1.0)
    shift = replace(LIBRARY["shift"], parameters=(own, form))
    library = Library([LIBRARY["slope"], shift])
    result = diagnose(DecayModel(), make_runs(4, slope_k=0.02, shift_s=0.05), library, Options())
    assert result.decision.verdict == "pair"
    assert set(result.which[0].effects) == {"slope", "shift"}


def test_an_effect_that_knows_no_zero_is_as_strong_as_its_value_is_known() -> None:
    shift = replace(LIBRARY["shift"], parameters=(between("s", 0.005, 0.2, "s"),))
    found = fit(DecayModel(), make_runs(0, shift_s=0.05), (shift,))
    value, low, high = found.values["shift.s"]
    assert strength(found, shift) == pytest.approx(value / ((high - low) / 3.92), rel=0.05)
    assert strength(found, shift) > 5.0


def test_a_second_effect_is_found_beside_a_first_that_explains_far_more() -> None:
    result = diagnose(DecayModel(), make_runs(4, slope_k=0.02, shift_s=0.05), LIBRARY, Options())
    assert result.decision.verdict == "pair"
    assert result.which[0].effects == ("shift", "slope")
    first, second = result.causes[:2]
    assert (first.name, second.name) == ("shift", "slope"), "in the order of what each closes"
    assert first.closes > second.closes
    assert min(first.probability, second.probability) > 0.95


class LateModel(DecayModel):
    """The toy with a third effect: durations that grow in the course of a run."""

    def predict(self, run: Run, values: Mapping[str, float]) -> Prediction:
        found = super().predict(run, values)
        found.features[PEAKS:] += values.get("late.c", 0.0) * np.linspace(0, 1, PEAKS) ** 4
        return found


def test_three_causes_are_found_together() -> None:
    runs = make_runs(4, slope_k=0.05, shift_s=0.05)
    for run in runs:
        run.features.values[PEAKS:] += 0.02 * np.linspace(0, 1, PEAKS) ** 4
    late = Effect("late", "wear", (signed("c", 0.1, "s"),), "D + c n⁴", "test")
    library = Library([*LIBRARY.values(), late])
    result = diagnose(LateModel(), runs, library, Options())
    assert result.decision.verdict == "several"
    assert result.decision.effects == ("late", "shift", "slope")
    assert diagnose(LateModel(), runs, library, Options(causes=2)).decision.verdict != "several"


def test_what_the_first_explains_elsewhere_does_not_count_against_a_second() -> None:
    """A twentieth of all that is explained, and all that is explained in the heights of the peaks."""
    result = diagnose(DecayModel(), make_runs(4, slope_k=0.02, shift_s=0.3), LIBRARY, Options())
    alone = {entry.effects: entry.log_evidence for entry in result.which}
    both, first = alone["shift", "slope"], alone["shift",]
    assert both - first < 0.06 * (both - alone[()])
    assert result.decision.effects == ("shift", "slope")


@pytest.mark.parametrize(
    ("late_s", "named"), [(0.004, ("shift",)), (0.008, ("shift",)), (0.012, ("late", "shift"))]
)
def test_a_second_that_only_mends_the_form_of_the_first_is_none(late_s: float, named: tuple[str]) -> None:
    """Tens of nats, but next to nothing of the first's amplitude in the same durations."""
    runs = make_runs(4, shift_s=0.5)
    for run in runs:
        run.features.values[PEAKS:] += late_s * np.linspace(0, 1, PEAKS) ** 4
    late = Effect("late", "wear", (signed("c", 0.1, "s"),), "D + c n⁴", "test")
    result = diagnose(LateModel(), runs, Library([*LIBRARY.values(), late]), Options())
    assert result.decision.effects == named


class UnevenModel(DecayModel):
    """The toy with the shift once more, in the first four durations alone."""

    def predict(self, run: Run, values: Mapping[str, float]) -> Prediction:
        found = super().predict(run, values)
        measured = run.features.values[:4]  # type: ignore[attr-defined]
        found.features[PEAKS : PEAKS + 4] += values.get("shift@first.s", 0.0) * measured**2
        return found


def test_a_law_on_a_family_and_on_one_of_its_channels_are_no_two_causes() -> None:
    """The first durations are late by more than the others: that is one delay, unevenly."""
    runs = make_runs(4, shift_s=0.05)
    for run in runs:
        run.features.values[PEAKS : PEAKS + 4] += 0.04 * run.features.values[:4] ** 2
    apart = replace(LIBRARY["shift"], name="shift@first")
    two = diagnose(UnevenModel(), runs, Library([*LIBRARY.values(), apart]), Options())
    assert two.decision.effects == ("shift", "shift@first")
    part = replace(apart, part_of="shift")
    one = diagnose(UnevenModel(), runs, Library([*LIBRARY.values(), part]), Options())
    assert one.which[0].effects == ("shift",)
    assert not any({"shift", "shift@first"} <= set(entry.effects) for entry in one.which)

"""The model's own discrepancy: wrong nuisances cost a group, and not the answer."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.core import Options, Scatter, diagnose, fit
from daq_app.gap.core.policy import POLICY
from daq_app.gap.own_model import Measured
from tests.support.gap.toy_wave import LIBRARY, PEAKS, DecayModel, make_runs


def spoilt(runs: list[Measured], sd_s: float, seed: int = 1) -> list[Measured]:
    """Durations that are far worse than they are said to be: errors with heavy tails."""
    rng = np.random.default_rng(seed)
    for run in runs:
        run.features.values[PEAKS:] += sd_s * rng.standard_t(3, PEAKS)
    return runs


@pytest.mark.parametrize("seed", range(4))
def test_a_nuisance_that_is_modelled_wrongly_is_blamed_on_nothing(seed: int) -> None:
    """Ten times the error that is declared: there is nothing to be sure of."""
    result = diagnose(DecayModel(), spoilt(make_runs(seed), 1e-2, seed), LIBRARY, Options())
    assert result.decision.verdict not in ("effect", "pair", "several")
    assert all(entry.probability < 0.9 for entry in result.which if entry.effects)


@pytest.mark.parametrize("seed", range(3))
def test_an_effect_is_named_beside_a_group_that_is_spoilt(seed: int) -> None:
    result = diagnose(DecayModel(), spoilt(make_runs(seed, slope_k=0.05), 5e-3, seed), LIBRARY, Options())
    assert result.which[0].effects == ("slope",)
    assert result.which[0].log_evidence - result.which[1].log_evidence > 2.0


def test_the_discrepancy_of_a_group_is_found() -> None:
    """Twenty times the nominal error in one group, none in the other."""
    runs = make_runs(5)
    rng = np.random.default_rng(2)
    for run in runs:
        run.features.values[PEAKS:] += 2e-2 * rng.normal(size=PEAKS)
    peaks, durations = np.sqrt(fit(DecayModel(), runs).sizes.discrepancy)
    assert peaks < 0.5
    assert durations == pytest.approx(20.0, rel=0.2)


def test_a_weak_effect_is_said_to_be_below_detection_with_the_size_that_would_show() -> None:
    for seed in range(12):
        result = diagnose(DecayModel(), make_runs(seed, slope_k=0.012), LIBRARY, Options())
        if result.decision.verdict == "below_detection":
            limit = next(d for d in result.detection if d.effect == "slope")
            assert 0.005 < limit.limit < 0.05
            assert "would have to be k" in result.decision.sentence
            return
    pytest.fail("no effect of three sd was below detection")


def test_a_weak_effect_that_the_runs_speak_for_is_below_detection_though_none_is_likelier() -> None:
    """Where only its rarity speaks against an effect, "no effect is missing" would pass over it."""
    rare = Options(policy=replace(POLICY, prior_null=0.9))
    seen = 0
    for seed in range(12):
        result = diagnose(DecayModel(), make_runs(seed, slope_k=0.01), LIBRARY, rare)
        none = next(entry for entry in result.which if not entry.effects)
        slope = next(entry for entry in result.which if entry.effects == ("slope",))
        if none.probability > 0.5 and slope.log_evidence > none.log_evidence + 0.5:
            assert result.decision.verdict == "below_detection"
            assert result.decision.effects == ("slope",)
            seen += 1
    assert seen > 1


def test_the_gate_opens_by_degrees() -> None:
    """The larger the part that no effect explains, the likelier something unknown."""
    unknown = []
    for step in (0.0, 0.01, 0.02, 0.04, 0.08):
        runs = make_runs(2, scatter=0.002, slope_k=0.05)
        for run in runs:
            run.features.values[PEAKS:] += step * np.sign(np.sin(np.arange(PEAKS)))
        unknown.append(diagnose(DecayModel(), runs, LIBRARY.without("free"), Options()).rest.unknown)
    assert unknown[0] < 0.05
    assert unknown[-1] > 0.9
    assert all(b > a - 0.05 for a, b in itertools.pairwise(unknown)), unknown


class ScatteringDurations(DecayModel):
    """Durations that scatter, long ones more than short ones."""

    scatters = (*DecayModel.scatters, Scatter("scatter of durations", 1e-3, 0.7, "s"))  # type: ignore[assignment]

    def predict(self, run, values):  # type: ignore[no-untyped-def]
        found = super().predict(run, values)
        of_durations = np.append(np.zeros(PEAKS), np.linspace(2.0, 0.4, PEAKS))
        return replace(found, loadings={**found.loadings, "scatter of durations": of_durations})


@pytest.mark.parametrize("seed", range(3))
def test_errors_that_scatter_are_nothing_unknown_and_errors_in_order_are(seed: int) -> None:
    """Five times what is expected, of the same sizes: by chance, and up and down in turn."""

    def judged(turned: bool):  # type: ignore[no-untyped-def]
        runs, rng = make_runs(seed), np.random.default_rng(seed)
        for run in runs:
            error = 5e-3 * rng.standard_normal(PEAKS)
            alternating = np.abs(error) * (-1.0) ** np.arange(PEAKS)
            run.features.values[PEAKS:] += alternating if turned else error
        result = diagnose(ScatteringDurations(), runs, LIBRARY.without("free"), Options())
        (durations,) = (group for group in result.rest.groups if group.observable == "duration")
        assert durations.discrepancy > 2.5
        return result, durations

    by_chance, scattered = judged(False)
    assert scattered.nats < 15.0
    assert by_chance.rest.unknown < 0.1
    in_order, turned = judged(True)
    assert turned.nats > 60.0
    assert in_order.decision.verdict == "none_of_these"

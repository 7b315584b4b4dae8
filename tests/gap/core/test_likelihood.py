"""The likelihood and the fit against direct dense algebra and known truths."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from daq_app.gap.core import Parameter, Prediction, Run, fit
from daq_app.gap.core.features import independent_fraction
from daq_app.gap.core.fitting.likelihood import Covariance, log_density
from daq_app.gap.core.parameters import between, positive
from tests.support.gap.toy_wave import LIBRARY, PEAKS, DecayModel, make_runs


@settings(max_examples=25)
@given(st.integers(1, 30), st.integers(0, 8), st.integers(0, 4), st.integers(0, 2**32 - 1))
def test_density_and_whitening_agree_with_dense_algebra(n: int, k: int, fixed: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    sd = rng.uniform(0.1, 2.0, n)
    free, diagonal, known = rng.normal(size=(n, k)), rng.normal(size=n), rng.normal(size=(n, fixed))
    prediction = Prediction(np.zeros(n), {"free": free, "diagonal": diagonal}, known if fixed else None)
    covariance = Covariance(sd, prediction, {"free": 0.7, "diagonal": 0.3})
    dense = np.diag(sd**2 + (0.3 * diagonal) ** 2) + 0.49 * free @ free.T + known @ known.T
    residual = rng.normal(size=n)
    assert log_density(residual, covariance) == pytest.approx(
        multivariate_normal(np.zeros(n), dense).logpdf(residual), rel=1e-9, abs=1e-8
    )
    whitened = covariance.whiten(residual)
    assert float(whitened @ whitened) == pytest.approx(
        float(residual @ np.linalg.solve(dense, residual)), rel=1e-8
    )
    np.testing.assert_allclose(
        covariance.back(covariance.whiten(residual)), np.linalg.solve(dense, residual), rtol=1e-6
    )
    np.testing.assert_allclose(covariance.inverse_diagonal(), np.diag(np.linalg.inv(dense)), rtol=1e-6)


def test_parameters_recovered_within_their_intervals() -> None:
    inside = total = 0
    for seed in range(12):
        runs = make_runs(seed, slope_k=0.04)
        rng = np.random.default_rng(seed)
        truth = {"r": 0.9 + 0.01 * rng.normal(), "D": 1.0 + 0.02 * rng.normal(), "slope.k": 0.04}
        found = fit(DecayModel(), runs, (LIBRARY["slope"],))
        for key, value in truth.items():
            _, low, high = found.values[key]
            inside += low <= value <= high
            total += 1
    assert inside >= total - 5, f"{inside} of {total} truths inside their 95 % interval"


def test_scatter_size_is_estimated_without_the_bias_of_a_profile() -> None:
    sizes = [fit(DecayModel(), make_runs(seed, scatter=0.006)).sigmas["scatter of r"] for seed in range(8)]
    assert np.mean(sizes) == pytest.approx(0.006, rel=0.08)


def test_evidence_of_a_linear_problem_is_exact() -> None:
    """With everything Gaussian, Laplace's evidence is the marginal density at the discrepancy found, less
    what its prior costs."""

    class Line:
        name = "line"
        scatters = ()
        nuisance = (Parameter("a", 0.5, 2.0), Parameter("b", -1.0, 0.7))

        def local_nuisance(self, run: object) -> tuple[Parameter, ...]:
            return ()

        def predict(self, run: object, values: dict[str, float]) -> Prediction:
            return Prediction(values["a"] + values["b"] * np.linspace(0, 1, 2 * PEAKS))

    run = make_runs(1, count=1)[0]
    run = replace(run, features=replace(run.features, sd=np.full(2 * PEAKS, 0.05)))
    x = np.linspace(0, 1, 2 * PEAKS)
    design = np.column_stack([np.ones_like(x), x])
    found = fit(Line(), [run])  # type: ignore[arg-type]
    square = np.repeat(found.sizes.discrepancy, PEAKS)
    dense = np.diag(run.features.sd**2 * (1.0 + square)) + design @ np.diag([4.0, 0.49]) @ design.T
    exact = multivariate_normal(design @ [0.5, -1.0], dense).logpdf(run.features.values)
    cost = float(np.log1p(found.sizes.discrepancy).sum())
    assert found.log_evidence == pytest.approx(exact - cost, abs=1e-3, rel=1e-6)


def test_one_sided_effect_at_zero_costs_evidence_but_little() -> None:
    """A strength that cannot be negative and is absent: Occam's factor, not an infinite penalty."""
    runs = make_runs(3)
    null = fit(DecayModel(), runs)
    found = fit(DecayModel(), runs, (LIBRARY["kick"],), null.known())
    assert -12.0 < found.log_evidence - null.log_evidence < 1.0


def test_autocorrelated_noise_counts_for_fewer_samples() -> None:
    rng = np.random.default_rng(0)
    white = rng.normal(size=20000)
    slow = np.zeros_like(white)
    for k in range(1, slow.size):
        slow[k] = 0.9 * slow[k - 1] + white[k]
    assert independent_fraction(white) > 0.8
    assert independent_fraction(slow) == pytest.approx(0.1 / 1.9, rel=0.25)


def test_parameters_know_their_coordinates() -> None:
    for parameter in (between("t", 1e-5, 9e-4), positive("z", 0.02), Parameter("m", 3.0, 0.5)):
        for u in (-0.7, 0.0, 1.3):
            assert parameter.unit_coordinate(parameter.value(u)) == pytest.approx(u)
    assert positive("z", 0.02).unit_bounds[0] == 0.0
    with pytest.raises(ValueError, match="positive"):
        Parameter("t", 1.0, -1.0)
    assert math.isinf(Parameter("m", 3.0, 0.5).unit_bounds[1])


def test_a_fit_beside_the_place_where_the_model_diverges_ends_in_numbers() -> None:
    """Features are no numbers just beyond the optimum: the slope there must not spoil the rest."""

    class Edge(DecayModel):
        def predict(self, run: Run, values: Mapping[str, float]) -> Prediction:
            made = super().predict(run, values)
            broken = made.features.copy()
            if values["D"] > 1.0:
                broken[-1] = math.nan
            return Prediction(broken, made.loadings)

    runs = make_runs(2)
    start = {("D", None): 0.0}
    found = fit(Edge(), runs, (), start)
    assert math.isfinite(found.log_evidence)
    assert all(math.isfinite(size) for size in found.sigmas.values())
    assert np.isfinite(found.u).all()
    assert found.values["D"][0] <= 1.0


@pytest.mark.filterwarnings("error::RuntimeWarning:daq_app.gap.core.fitting.fit")
def test_a_model_that_leaps_beyond_all_measure_beside_the_optimum_has_an_evidence_all_the_same() -> None:
    class Wild(DecayModel):
        def predict(self, run: Run, values: Mapping[str, float]) -> Prediction:
            made = super().predict(run, values)
            if values.get("kick.j", 0.0) > 0.0:
                made.features[-1] = 1e200
            return made

    runs = make_runs(2)
    null = fit(DecayModel(), runs)
    found = fit(Wild(), runs, (LIBRARY["kick"],), null.known())
    assert found.log_evidence == pytest.approx(null.log_evidence, abs=1.0)
    assert all(local["kick.j"][0] == 0.0 for local in found.local_values)

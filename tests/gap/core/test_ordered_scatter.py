"""A scatter that takes up a law which no effect has is seen by its order."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from daq_app.gap.core import fit
from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.fitting.problem import Problem
from daq_app.gap.core.judging.scattering import beyond_expected
from daq_app.gap.core.policy import POLICY
from tests.support.gap.toy_wave import DecayModel, make_runs


def _cost(scatter: float, slope: float, of_r: float) -> float:
    """Nats of a fit whose scatter of r is `of_r`, of runs with such a scatter and slope of r."""
    runs = make_runs(3, scatter=scatter, slope_k=slope)
    found = fit(DecayModel(), runs)
    sizes = found.sizes
    log_scatter = np.array([math.log(of_r)])
    linear = replace(found, sizes=replace(sizes, log_scatter=log_scatter)).linear(
        Problem(Experiment.of(DecayModel(), runs), ())
    )
    return float(beyond_expected(linear, POLICY).sum())


def test_a_scatter_costs_where_it_is_larger_than_expected_and_in_order() -> None:
    """r that falls with the amplitude is off one impact after another; r that scatters is not."""
    assert _cost(scatter=0.002, slope=0.2, of_r=0.05) > 20.0
    assert _cost(scatter=0.05, slope=0.0, of_r=0.05) == 0.0
    assert _cost(scatter=0.002, slope=0.2, of_r=0.01) == 0.0, "two prior sd are expected"

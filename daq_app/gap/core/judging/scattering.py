"""Misfit of a group of features that a larger scatter says nearly as well.

Where all features of a group scatter, a discrepancy of the group and the scatter are two words for one thing,
and the data tell them apart by how errors are shared out between large and small values alone. Scatter is
independent from one feature to the next: residuals that follow one another in order are no scatter.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.fitting.likelihood import Sizes
from daq_app.gap.core.fitting.linear import Linear, relaxed
from daq_app.gap.core.policy import Policy

_CLIPPED = 3.0
"""Residuals count up to so many sd in the test of order, so that no pair of them decides."""
_ROUNDS = 8


def beyond_scatter(linear: Linear, costs: FloatArray, policy: Policy) -> FloatArray:
    """What no scatter explains of what the misfit of each group costs, in nats, shape (group,).

    `linear` is the fit that leaves it, `costs`, (group,), what it costs as a discrepancy. A group costs no
    more than what the restricted likelihood loses where a larger scatter stands in place of its discrepancy.
    """
    nats, left = costs.copy(), linear.marginal_at(linear.solution())
    for group in np.flatnonzero(costs > 0.0):
        if _order(_in_group(linear, int(group))) > policy.ordered_sd:
            continue
        for sizes in _with_scatter(linear, int(group)):
            other, u = relaxed(linear.under(sizes), _ROUNDS)
            nats[group] = min(nats[group], max(other.marginal_at(u) - left, 0.0))
    return nats


def beyond_expected(linear: Linear, policy: Policy) -> FloatArray:
    """What scatters cost beyond what is expected of them where they are in order, in nats, shape (group,).

    A law that no effect has makes a scatter as large as it takes, and no group misfits; what it makes follows
    from one feature to the next, as scatter does not.
    """
    nats = np.zeros(len(linear.problem.experiment.groups))
    for scatter, log_size in zip(linear.problem.model.scatters, linear.sizes.log_scatter, strict=True):
        beyond = float(log_size) - math.log(scatter.median) - policy.expected_scatter_sd * scatter.log_sd
        if beyond <= 0.0:
            continue
        counts = np.array([_loaded(linear, scatter.name, group) for group in range(nats.size)])
        residuals = [row for group in np.flatnonzero(counts) for row in _in_group(linear, int(group))]
        if _order(residuals) > policy.ordered_sd:
            nats += counts * beyond
    return nats


def _loaded(linear: Linear, scatter: str, group: int) -> int:
    """How many features of a group a scatter acts on."""
    loadings = (line.prediction.loadings.get(scatter) for line in linear.lines)
    indices = linear.problem.experiment.groups.index
    return sum(
        int(np.count_nonzero(np.abs(loading).reshape(loading.shape[0], -1)[index == group].sum(axis=1)))
        for loading, index in zip(loadings, indices, strict=True)
        if loading is not None
    )


def _with_scatter(linear: Linear, group: int) -> list[Sizes]:
    """Sizes with the discrepancy of a group in a scatter instead, for each that acts on all its features."""
    sizes = linear.sizes
    found = []
    for k, scatter in enumerate(linear.problem.model.scatters):
        shares = _shares(linear, scatter.name, group)
        if shares is None:
            continue
        log_scatter, discrepancy = sizes.log_scatter.copy(), sizes.discrepancy.copy()
        handed = float(discrepancy[group] * np.median(shares))
        log_scatter[k] = 0.5 * math.log(math.exp(2.0 * log_scatter[k]) + handed)
        discrepancy[group] = Sizes.nominal(linear.problem.experiment).discrepancy[group]
        found.append(replace(sizes, log_scatter=log_scatter, discrepancy=discrepancy))
    return found


def _shares(linear: Linear, scatter: str, group: int) -> FloatArray | None:
    """Nominal variance of each feature over what the scatter has in it, (n,); None where one has none."""
    groups = linear.problem.experiment.groups
    shares: list[FloatArray] = []
    for line, index, variance in zip(linear.lines, groups.index, groups.variance, strict=True):
        rows = index == group
        loading = line.prediction.loadings.get(scatter)
        if loading is None or loading.ndim > 1 or not np.all(loading[rows]):
            return None
        shares.append(variance[rows] / loading[rows] ** 2)
    return np.concatenate(shares)


def _in_group(linear: Linear, group: int) -> list[FloatArray]:
    """Residuals of a group over their own sd, run by run in the order of the features."""
    return [
        (line.residual / covariance.marginal_sd)[index == group]
        for line, covariance, index in zip(
            linear.lines, linear.covariances, linear.problem.experiment.groups.index, strict=True
        )
    ]


def _order(residuals: list[FloatArray]) -> float:
    """|Correlation| of each residual with the next, in standard errors of independent ones."""
    clipped = [np.clip(run, -_CLIPPED, _CLIPPED) for run in residuals]
    square = math.fsum(float(run @ run) for run in clipped)
    pairs = sum(max(run.size - 1, 0) for run in clipped)
    if pairs == 0 or square == 0.0:
        return 0.0
    product = math.fsum(float(run[:-1] @ run[1:]) for run in clipped)
    return abs(product) / square * math.sqrt(pairs)

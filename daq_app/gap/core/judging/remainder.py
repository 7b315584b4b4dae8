"""What the best hypothesis leaves: how large, where, and how likely something unknown is behind it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from daq_app.gap.core.effects import Library
from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.fitting.fit import Fit, effects_of
from daq_app.gap.core.fitting.likelihood import Sizes
from daq_app.gap.core.fitting.problem import Problem
from daq_app.gap.core.judging.other_forms import FreeForm
from daq_app.gap.core.judging.scattering import beyond_expected, beyond_scatter
from daq_app.gap.core.policy import Policy


@dataclass(frozen=True, slots=True)
class GroupRest:
    """What remains in one group of features."""

    channel: str
    observable: str
    n: int
    discrepancy: float
    """What the model itself gets wrong there, in nominal sd."""
    in_noise: float
    """Rms of what remains over noise and scatter."""
    nats: float
    """What it costs that the model misfits this group by more than the usual discrepancy, and by more than
    scatter says."""


@dataclass(frozen=True, slots=True)
class Remainder:
    """Gaps are in units of noise and scatter, without the model's discrepancy; 1 is nothing."""

    nominal: float
    """Gap with all parameters at the centres of their priors."""
    before: float
    """Gap of the fit without any effect."""
    after: float
    """Gap of the best hypothesis."""
    nats: float
    """What the misfit beyond the usual discrepancy costs in log likelihood: n ln(ν/ν₀) over the groups."""
    share: float
    """Share of it in the gap: what remains over what remains and what is explained, both in nats. Nats grow
    with the logarithm of a misfit, so that no single group that is wild outweighs all others."""
    groups: tuple[GroupRest, ...]
    """Those that cost most come first."""
    unknown: float
    """Probability that something is there that is not in the library."""
    form: str = ""
    """Family of which another form gains most on top of the best hypothesis, where that matters."""
    together: int = 0
    """How many single instruments the best hypothesis has off at once, where they ask for one cause."""

    def known(self, policy: Policy) -> float:
        """Probability that the answer is among the hypotheses, which share it."""
        return (1.0 - self.unknown) * (1.0 - policy.unforeseen)

    @property
    def words(self) -> str:
        """The remainder with its place."""
        if self.together:
            return f"{self.together} single instruments are off at once, which asks for one cause of them all"
        if not self.groups or self.nats < 1.0:
            return "nothing remains beyond noise, scatter and what the model is usually wrong by"
        worst = self.groups[0]
        return (
            f"{100 * min(self.share, 1.0):.0f} % of the gap remains, most of it in the {worst.observable} "
            f"of {worst.channel} ({worst.in_noise:.1f} times noise and scatter)"
        )


def remainder(
    experiment: Experiment,
    library: Library,
    null: Fit,
    best: Fit,
    forms: Sequence[FreeForm],
    gains: Mapping[str, float],
    policy: Policy,
) -> Remainder:
    """What `best` leaves of what `null` leaves, on the yardstick of the scatter of `best`.

    `gains`: what each effect of `best` adds to the log evidence of the others, as far as it is known.
    """
    sizes = best.sizes.without_discrepancy()
    local = {key: u for key, u in null.known().items() if key[1] is not None}
    nominal = _size(_white(experiment, Problem(experiment, ()), local, sizes))
    before = _size(_white(experiment, Problem(experiment, ()), null.known(), sizes))
    problem = Problem(experiment, effects_of(best.effects, library))
    white = _white(experiment, problem, best.known(), sizes)
    after = _size(white)
    costs = misfit_nats(experiment, best.sizes, policy)
    linear = best.linear(problem)
    costs = beyond_scatter(linear, costs, policy) + beyond_expected(linear, policy)
    groups = _groups(experiment, best, white, costs)
    nats = math.fsum(group.nats for group in groups)
    explained = max(best.log_evidence - null.log_evidence, 0.0)
    share = nats / max(nats + explained, 1e-9)
    largest = max((group.discrepancy for group in groups), default=0.0)
    rest, form = _unknown(share, nats, largest, policy), ""
    gain = max((f.excess for f in forms), default=0.0)
    if gain > 0.0 and best.effects:
        bar = max(policy.form_nats, policy.form_share * explained)
        other = policy.chance(gain, bar)
        rest = 1.0 - (1.0 - rest) * (1.0 - other)
        form = max(forms, key=lambda f: f.excess).family if other > policy.refused else ""
    for place in sorted({effect.place for effect in library.values()} - {""}):
        of_place = [name for name in best.effects if library[name].place == place]
        if all(name in gains for name in of_place):
            gained = math.fsum(gains[name] for name in of_place)
            rest = 1.0 - (1.0 - rest) * (1.0 - _unknown_at(place, gained, groups, policy))
    together = sum(1 for name in best.effects if library[name].part_of)
    if together > policy.lone_instruments:
        rest = 1.0 - (1.0 - rest) * (1.0 - policy.common_cause)
    else:
        together = 0
    return Remainder(nominal, before, after, nats, share, groups, rest, form, together)


def _unknown(share: float, nats: float, largest: float, policy: Policy) -> float:
    """Probability of something unknown behind a remainder of that share and size.

    A share that matters, or one group whose discrepancy (`largest`) is more than any model is wrong by.
    """
    counts = policy.chance(share, policy.unknown_share)
    matters = policy.chance(nats, policy.unknown_nats)
    gross = policy.chance(largest, policy.unknown_misfit)
    return 1.0 - (1.0 - counts * matters) * (1.0 - gross)


def _unknown_at(place: str, gain: float, groups: Sequence[GroupRest], policy: Policy) -> float:
    """Probability that one channel has something else than what is named on it, which gains so much (nats).

    Beside a strong cause elsewhere no remainder of one channel is a share of the whole that matters.
    """
    left = math.fsum(group.nats for group in groups if group.channel == place)
    share = left / max(left + max(gain, 0.0), 1e-9)
    return policy.chance(share, policy.unknown_share) * policy.chance(left, policy.unknown_nats)


def _white(
    experiment: Experiment,
    problem: Problem,
    known: dict[tuple[str, int | None], float],
    sizes: Sizes,
) -> list[FloatArray]:
    u = problem.start(known)
    residuals = []
    for i, run in enumerate(experiment.runs):
        prediction = problem.predict(i, u)
        covariance = sizes.covariance(experiment, i, prediction)
        residuals.append(covariance.whiten(run.features.values - prediction.features))
    return residuals


def _size(white: Sequence[FloatArray]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(white) ** 2)))


def misfit_nats(experiment: Experiment, sizes: Sizes, policy: Policy) -> FloatArray:
    """What the misfit of each group beyond the usual discrepancy costs, n ln(ν/ν₀), shape (group,)."""
    count = sum(np.bincount(index, minlength=len(experiment.groups)) for index in experiment.groups.index)
    beyond = np.maximum(np.sqrt(sizes.discrepancy) / policy.usual_discrepancy, 1.0)
    return np.asarray(count * np.log(beyond), dtype=np.float64)


def _groups(
    experiment: Experiment, best: Fit, white: Sequence[FloatArray], costs: FloatArray
) -> tuple[GroupRest, ...]:
    groups = experiment.groups
    square, count = np.zeros(len(groups)), np.zeros(len(groups))
    for index, z in zip(groups.index, white, strict=True):
        square += np.bincount(index, z**2, len(groups))
        count += np.bincount(index, minlength=len(groups))
    rests = []
    for (channel, observable), n, nu, s, nats in zip(
        groups.names, count, np.sqrt(best.sizes.discrepancy), square, costs.tolist(), strict=True
    ):
        size = math.sqrt(float(s) / max(float(n), 1.0))
        rests.append(GroupRest(channel, observable, int(n), float(nu), size, nats))
    return tuple(sorted(rests, key=lambda g: (-g.nats, -g.in_noise)))

"""What a further effect gains on top of a fit, by one linear step from each of its starts.

The columns of the fit are whitened once; an effect adds its own few, and the step of all unknowns follows
from the Schur complement of the fit's Hessian.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from daq_app.gap.core.effects import Effect
from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.fitting import dense
from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.fitting.fit import Fit, starts
from daq_app.gap.core.fitting.likelihood import Sizes
from daq_app.gap.core.fitting.linear import Linear, Mask, not_pressed
from daq_app.gap.core.fitting.problem import Columns, Linearised, Problem

_FLAT = 1.0 - 1e-4
"""Share of the information of a prior that is taken away where data alone have to speak."""
_PASSES = 3


@dataclass(frozen=True, slots=True)
class Step:
    """One linear step of all unknowns of a hypothesis."""

    gain: float
    """In log posterior."""
    evidence: float
    """Gain in log evidence, by Laplace's approximation."""
    known: dict[tuple[str, int | None], float]
    """Unit coordinates where the step ends."""
    sizes: Sizes


@dataclass(frozen=True, slots=True)
class Screened:
    """What one effect promises on top of a fit."""

    effect: str
    robust: Step
    """With the discrepancy of the fit."""
    strict: Step
    """With next to no discrepancy: a fault that a group's discrepancy has swallowed shows here."""
    sd: tuple[float, ...]
    """Posterior sd of the effect's shared parameters in unit coordinates, with the fit's discrepancy."""
    starts: tuple[FloatArray, ...]
    """Unit coordinates of the effect's unknowns from which these steps begin."""


@dataclass(frozen=True, slots=True)
class Score:
    """Score test of a form on top of a fit."""

    gain: float
    """In log posterior."""
    determined: float
    """How many coefficients of the form the runs determine besides what the fit has already."""
    coefficient: float = math.nan
    """Where the form has one coefficient: what the runs alone make of it, in its unit; else NaN."""
    error: float = math.nan
    """Its standard deviation."""


class Base:
    """A fit, linearised, that further effects are put on."""

    def __init__(
        self, experiment: Experiment, effects: Sequence[Effect], found: Fit, frozen: Columns
    ) -> None:
        """`frozen`: columns of the Jacobian without any effect."""
        self.experiment, self.effects, self.known = experiment, tuple(effects), found.known()
        problem = Problem(experiment, effects)
        u = problem.start(self.known)
        columns = {**frozen, **found.columns}
        lines = [problem.linearise(i, u, None, columns, exact=False) for i in range(len(experiment.runs))]
        self.robust = Linear(problem, u, lines, found.sizes)
        nominal = Sizes.nominal(experiment).discrepancy
        self.strict = self.robust.under(Sizes(found.sizes.log_scatter, nominal))

    def screened(self, effect: Effect, begin: Sequence[FloatArray] = ()) -> Screened:
        """The best step from any start of the effect, or from those of its unknowns at `begin`."""
        problem = Problem(self.experiment, (*self.effects, effect))
        base = problem.start(self.known)
        robust: list[tuple[Step, _Attached]] = []
        strict: list[tuple[Step, _Attached]] = []
        for u in _begun(problem, base, effect, begin) or starts(problem, base, self.known):
            lines = _beside(problem, u, effect)
            if not all(np.all(np.isfinite(line.residual)) for line in lines):
                continue  # the model diverges there
            for kept, linear in ((robust, self.robust), (strict, self.strict)):
                attached = _Attached(linear, problem, u, lines, effect.name)
                kept.append((attached.step(), attached))
        first = max(robust, key=lambda entry: entry[0].gain)
        shared = [k for k, q in enumerate(first[1].unknowns) if problem.unknowns[q].run is None]
        spread = np.sqrt(np.diag(np.linalg.inv(first[1].own)))[shared]
        second = max(strict, key=lambda entry: entry[0].gain)
        begun = (first[1].start, second[1].start)
        apart = begun if np.any(begun[0] != begun[1]) else begun[:1]
        return Screened(effect.name, first[0], second[0], tuple(float(v) for v in spread), apart)

    def score(self, form: Effect) -> Score:
        """Score test of a form, with the fit's discrepancy.

        The named effects give way as far as the data let them: a prior that would rather have an effect
        weaker is no evidence for another form of it.
        """
        problem = Problem(self.experiment, (*self.effects, form))
        u = problem.start(self.known)
        lines = _beside(problem, u, form)
        named = np.array([_FLAT * bool(q.effect) for q in self.robust.problem.unknowns])
        attached = _Attached(self.robust, problem, u, lines, form.name, named)
        free = attached.free(np.zeros(len(attached.unknowns)))
        own = attached.own[np.ix_(free, free)]
        if not free.any():
            return Score(0.0, 0.0)
        slope = attached.slope[free]
        variance = np.linalg.inv(own)
        gain = 0.5 * float(slope @ variance @ slope)
        determined = float(np.sum(1.0 - np.diag(variance)))
        if len(attached.unknowns) > 1:
            return Score(gain, determined)
        information = max(float(own[0, 0]) - 1.0, 1e-12)  # the prior has a weight of one
        unit = problem.unknowns[attached.unknowns[0]].parameter.sd
        return Score(gain, determined, -unit * float(slope[0]) / information, unit / math.sqrt(information))


def _beside(problem: Problem, u: FloatArray, effect: Effect) -> list[Linearised]:
    """Residuals at `u`, (p,), and the columns of the effect alone: those of the fit are known."""
    return [problem.linearise(i, u, exact=False, effect=effect.name) for i in range(len(problem.runs))]


def _begun(
    problem: Problem, base: FloatArray, effect: Effect, begin: Sequence[FloatArray]
) -> list[FloatArray]:
    """Vectors of unknowns with those of an effect at each of some coordinates."""
    own = [k for k, q in enumerate(problem.unknowns) if q.effect == effect.name]
    vectors = [base.copy() for _ in begin]
    for u, coordinates in zip(vectors, begin, strict=True):
        u[own] = coordinates
    return vectors


class _Attached:
    """The unknowns of one more effect beside those of a linearised fit."""

    def __init__(
        self,
        linear: Linear,
        problem: Problem,
        u: FloatArray,
        lines: Sequence[Linearised],
        effect: str,
        flat: FloatArray | None = None,
    ) -> None:
        """`flat`: share of each prior of the fit's unknowns that is taken away."""
        self.problem, self.linear = problem, linear
        self.unknowns = [k for k, q in enumerate(problem.unknowns) if q.effect == effect]
        place = {k: j for j, k in enumerate(self.unknowns)}
        self.start = u[self.unknowns]
        base = linear.problem
        across = np.zeros((len(base), len(self.unknowns)))
        own, slope_own = np.eye(len(self.unknowns)), self.start.copy()
        slope_base = linear.u.copy() if flat is None else (1.0 - flat) * linear.u
        square = float(linear.u @ linear.u + self.start @ self.start)
        for i, line in enumerate(lines):
            mine = [k for k in problem.columns(i).tolist() if k in place]
            places = np.array([place[k] for k in mine], dtype=np.intp)
            weight = problem.runs[i].features.independent_fraction
            white = linear.covariances[i].whiten(np.column_stack([line.jacobian[:, mine], line.residual]))
            theirs, columns = linear.white[i][:, :-1], base.columns(i)
            across[columns[:, None], places] += weight * (theirs.T @ white[:, :-1])
            own[places[:, None], places] += weight * (white[:, :-1].T @ white[:, :-1])
            slope_base[columns] -= weight * (theirs.T @ white[:, -1])
            slope_own[places] -= weight * (white[:, :-1].T @ white[:, -1])
            square += weight * float(white[:, -1] @ white[:, -1])
        self._factor = linear.factor if flat is None else dense.factor(linear.hessian - np.diag(flat))
        self._across, self._slope_base = across, slope_base
        both = dense.solve(self._factor, across)
        self.own: FloatArray = own - across.T @ both
        self.slope: FloatArray = slope_own - both.T @ slope_base
        self._reached = 0.5 * square - 0.5 * float(slope_base @ dense.solve(self._factor, slope_base))

    def free(self, move: FloatArray) -> Mask:
        """Which of the effect's unknowns no bound stops, after a move of them."""
        low, high = self.problem.low[self.unknowns], self.problem.high[self.unknowns]
        return not_pressed(self.start + move, self.slope + self.own @ move, low, high)

    def step(self) -> Step:
        """The step within the bounds of the effect's parameters."""
        low = self.problem.low[self.unknowns] - self.start
        high = self.problem.high[self.unknowns] - self.start
        move = np.zeros(len(self.unknowns))
        for _ in range(_PASSES):
            free = self.free(move)
            if not free.any():
                break
            slope = self.slope + self.own @ move
            trial = move.copy()
            trial[free] -= np.linalg.solve(self.own[np.ix_(free, free)], slope[free])
            clipped = np.clip(trial, low, high)
            inside = bool(np.array_equal(clipped, trial))
            move = clipped
            if inside:
                break
        reached = self._reached + float(self.slope @ move) + 0.5 * float(move @ self.own @ move)
        linear = self.linear
        gain = linear.lowest - reached
        moved = linear.u - dense.solve(self._factor, self._slope_base + self._across @ move)
        own = [self.problem.unknowns[k] for k in self.unknowns]
        ends = zip(
            (*linear.problem.unknowns, *own), (*moved.tolist(), *(self.start + move).tolist()), strict=True
        )
        known = {(unknown.key, unknown.run): u for unknown, u in ends}
        evidence = gain - 0.5 * float(np.linalg.slogdet(self.own)[1])
        return Step(gain, evidence, known, linear.sizes)

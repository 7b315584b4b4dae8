"""What is wrong with a model or its recordings before anything is fitted: each is silent or cryptic later.

A refusal names the run, the feature or the effect that stands out, and what to do. A note does not stop the
diagnosis; it becomes one of its stated limits.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from daq_app.gap.core import Effect, Library, Model, Parameter, Run
from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.fitting.problem import Problem

_CONSTANT_FROM: Final = 5
"""Equal values of one kind of feature from which they count as constant data; fewer may be chance."""
_SILENT: Final = 1e-9
"""Change of a feature, in its noise sd, below which nothing was changed: rounding."""
_HARDLY_SEEN: Final = 0.01
"""Largest change, in noise sd, below which an effect of the size of its prior cannot be found."""
_STANDS_OUT: Final = 30.0
"""Times the median misfit of the other runs from which a run is named: units or files mixed up."""
_WILD: Final = 12.0
"""Times the median misfit of its kind of feature from which a feature is named: a missed or doubled event."""
_REWEIGHTED: Final = 20
"""Rounds of reweighting: enough for a few wild features in a hundred."""
_NAMED: Final = 3
"""Features that are named at most."""
_TRIED_SD: Final = (1.0, -1.0, 3.0)
"""Unit coordinates at which a parameter is tried."""


@dataclass(frozen=True, slots=True)
class Lint:
    """Refusals and notes, sentences each."""

    refusals: tuple[str, ...]
    notes: tuple[str, ...]


def check_model(model: Model, library: Library, runs: Sequence[Run]) -> Lint:
    """All that can be said before a fit; a part that cannot be checked for an earlier fault is left out."""
    refusals = [*_names(runs), *_recordings(runs)]
    if refusals or not runs:
        return Lint(tuple(refusals or ["There is no run to diagnose. Give at least one recording."]), ())
    refusals = [words for run in runs for words in _prediction(model, run)]
    if refusals:
        return Lint(tuple(refusals), ())
    asked = _Asked(model, runs)
    refusals = [*asked.silent_unknowns(), *asked.scatters_without_use()]
    notes = [*_amplitudes(runs), *asked.run_that_stands_out(), *asked.features_that_stand_out()]
    for effect in library.values():
        if effect.kind == "departure":
            continue
        silent, weak = asked.effect(effect)
        refusals += silent
        notes += weak
    return Lint(tuple(refusals), tuple(notes))


def _names(runs: Sequence[Run]) -> list[str]:
    counts = Counter(run.name for run in runs)
    return [
        f"{count} runs are called {name}. Give each a name of its own: held-out runs are told by it."
        for name, count in counts.items()
        if count > 1
    ]


def _recordings(runs: Sequence[Run]) -> list[str]:
    """Runs without features, and features that never change."""
    doubts = []
    for run in runs:
        if len(run.features) == 0:
            doubts.append(f"Run {run.name} has no features. Check the recording, or what `load` keeps of it.")
        groups: dict[tuple[str, str], list[float]] = {}
        for label, value in zip(run.features.labels, run.features.values, strict=True):
            groups.setdefault((label.channel, label.observable), []).append(float(value))
        doubts += [
            f"{observable} of {channel} is {values[0]:g} in all {len(values)} places of run {run.name}: "
            "constant data. Check that the channel was connected, or leave it out."
            for (channel, observable), values in groups.items()
            if len(values) >= _CONSTANT_FROM and np.ptp(values) == 0.0
        ]
    return doubts


def _problem(model: Model, run: Run, effects: Sequence[Effect] = ()) -> Problem:
    """One run by itself, to be predicted."""
    return Problem(Experiment.without_groups(model, [run]), effects)


def _prediction(model: Model, run: Run) -> list[str]:
    """Whether the model predicts this run at the centre of its priors."""
    problem = _problem(model, run)
    try:
        predicted = problem.predict(0, problem.start({}))
    except KeyError as error:
        known = ", ".join(unknown.key for unknown in problem.unknowns)
        return [
            f"The model reads {error} for run {run.name}, which is no parameter of it; there are {known}. "
            'An effect\'s parameter is absent while the effect is not tried: read it with .get("…", 0.0).'
        ]
    except Exception as error:
        return [f"The model fails for run {run.name}: {type(error).__name__}: {error}."]
    n = len(run.features)
    shape = np.shape(predicted.features)
    if shape != (n,):
        return [
            f"The model predicts features of shape {shape} for run {run.name}, which has {n}: one number for "
            "each, in the order of `load`."
        ]
    bad = np.flatnonzero(~np.isfinite(predicted.features))
    if bad.size:
        label = run.features.labels[int(bad[0])]
        return [
            f"The model predicts {predicted.features[bad[0]]} for {label.observable} of {label.channel} "
            f"(feature {bad[0] + 1}) of run {run.name}, at the centre of its priors."
        ]
    return _loadings(model, run, predicted.loadings, n)


def _loadings(model: Model, run: Run, loadings: Mapping[str, FloatArray], n: int) -> list[str]:
    declared = [scatter.name for scatter in model.scatters]
    doubts = [
        f"The model gives loadings of the scatter {name}, which it does not declare"
        f" ({', '.join(declared) or 'it declares none'}). Add Scatter({name!r}, …)."
        for name in loadings
        if name not in declared
    ]
    return doubts + [
        f"The loadings of the scatter {name} have shape {np.shape(value)} for run {run.name}: "
        f"({n},) for one draw each, or ({n}, k)."
        for name, value in loadings.items()
        if np.ndim(value) not in (1, 2) or np.shape(value)[0] != n
    ]


def _amplitudes(runs: Sequence[Run]) -> list[str]:
    """`Label.amplitude` carries the side: without its sign no left and right can be told apart."""
    sizes = np.array([label.amplitude for run in runs for label in run.features.labels])
    values = np.concatenate([run.features.values for run in runs])
    if not np.any(sizes):
        return [
            "No feature has an amplitude: whether the gap grows with the size of the motion is not examined."
        ]
    if np.all(sizes >= 0.0) and np.any(values < 0.0) and np.any(values > 0.0):
        return [
            "Features have both signs, but amplitudes have none: give the amplitude the sign of its side, "
            "or a difference between the sides is not examined."
        ]
    return []


class _Asked:
    """The model's answers at the centre of its priors and beside it."""

    def __init__(self, model: Model, runs: Sequence[Run]) -> None:
        self.model, self.runs = model, runs
        problems = [_problem(model, run) for run in runs]
        self.centre = [problem.predict(0, problem.start({})) for problem in problems]

    def scatters_without_use(self) -> list[str]:
        """Scatters that no prediction has a loading of."""
        loadings = [prediction.loadings for prediction in self.centre]
        return [
            f"The scatter {scatter.name} is declared, but no prediction has a loading of it: its size "
            "could be anything. Return Prediction(features, {name: loadings}), or leave it out."
            for scatter in self.model.scatters
            if not any(np.any(one.get(scatter.name, 0.0)) for one in loadings)
        ]

    def silent_unknowns(self) -> list[str]:
        """Parameters of the model itself that change no feature."""
        doubts = []
        for index, run in enumerate(self.runs):
            for unknown in _problem(self.model, run).unknowns:
                if unknown.run is None and index > 0:
                    continue  # shared by all runs: asked once, of all of them
                others = self.runs if unknown.run is None else [run]
                change = max(self._change(other, (), unknown.key, unknown.parameter) for other in others)
                if change < _SILENT:
                    of_run = "" if unknown.run is None else f" of run {run.name}"
                    doubts.append(
                        f"Parameter {unknown.key} changes no feature{of_run}. Does the model read it under "
                        "that name?"
                    )
        return doubts

    def effect(self, effect: Effect) -> tuple[list[str], list[str]]:
        """(refusals, notes) of one effect."""
        changes = {
            p.name: max(self._change(run, (effect,), effect.key(p), p) for run in self.runs)
            for p in effect.parameters
        }
        silent = [name for name, change in changes.items() if change < _SILENT]
        if len(silent) == len(changes) and len(changes) > 1:
            keys = ", ".join(map(effect.key, effect.parameters))
            return [f"Effect {effect.name} changes no feature. Does the model read {keys}?"], []
        if silent:
            keys = ", ".join(f"{effect.name}.{name}" for name in silent)
            return [f"Effect {effect.name} changes no feature by {keys}. Does the model read that name?"], []
        if max(changes.values()) < _HARDLY_SEEN:
            return [], [
                f"Effect {effect.name} of the size of its prior changes no feature by more than "
                f"{max(changes.values()):.2g} of its noise: these runs cannot show it."
            ]
        return [], []

    def run_that_stands_out(self) -> list[str]:
        """A run far worse than the others at the centre of the priors: a unit, a file of something else."""
        if len(self.runs) < 3:
            return []
        misfit = [
            np.abs(run.features.values - centre.features) / run.features.sd
            for run, centre in zip(self.runs, self.centre, strict=True)
        ]
        sizes = np.array([np.sqrt(np.mean(z**2)) for z in misfit])
        worst = int(np.argmax(sizes))
        others = float(np.median(np.delete(sizes, worst)))
        if sizes[worst] <= _STANDS_OUT * max(others, 1.0):
            return []
        label = self.runs[worst].features.labels[int(np.argmax(misfit[worst]))]
        return [
            f"Run {self.runs[worst].name} is {sizes[worst] / max(others, 1.0):.0f} times farther from the "
            f"model than the others, most in {label.observable} of {label.channel}: check its units."
        ]

    def features_that_stand_out(self) -> list[str]:
        """The wildest features of their kind, beside what each run's parameters can follow."""
        kinds: dict[tuple[str, str], list[tuple[float, str]]] = {}
        for run in self.runs:
            misfit = np.abs(_robust_residual(_problem(self.model, run)))
            for k, label in enumerate(run.features.labels):
                where = f"feature {k + 1} of run {run.name} ({label.observable} of {label.channel})"
                kinds.setdefault((label.channel, label.observable), []).append((float(misfit[k]), where))
        wild = []
        for features in kinds.values():
            usual = max(float(np.median([size for size, _ in features])), 1.0)
            wild += [(size / usual, where) for size, where in features if size > _WILD * usual]
        named = [f"{where}, {times:.0f} times" for times, where in sorted(wild, reverse=True)[:_NAMED]]
        if not named:
            return []
        return [
            f"{len(wild)} features are much farther from the model than is usual for their kind: "
            f"{'; '.join(named)}. Was an event missed or counted twice?"
        ]

    def _change(self, run: Run, effects: Sequence[Effect], key: str, parameter: Parameter) -> float:
        """Largest change of a feature of a run, in noise sd, that a parameter makes from its centre."""
        problem = _problem(self.model, run, effects)
        low, high = parameter.unit_bounds
        # An effect's time constant does nothing while its strength is zero.
        beside = {e.key(p): p.start_coordinates()[-1] for e in effects for p in e.parameters}
        here = self._predict(problem, {**beside, key: min(max(0.0, low), high)})
        with np.errstate(all="ignore"):
            return max(
                _largest(
                    (self._predict(problem, {**beside, key: min(max(u, low), high)}) - here) / run.features.sd
                )
                for u in {*parameter.start_coordinates(), *_TRIED_SD}
            )

    def _predict(self, problem: Problem, moved: Mapping[str, float]) -> FloatArray:
        """Features with some unknowns moved to unit coordinates; NaN where the model cannot be asked."""
        u = problem.start({})
        for k, unknown in enumerate(problem.unknowns):
            u[k] = moved.get(unknown.key, u[k])
        try:
            return np.asarray(problem.predict(0, u).features, dtype=np.float64)
        except (ArithmeticError, ValueError):
            return np.full(len(problem.runs[0].features), np.nan)


def _robust_residual(problem: Problem) -> FloatArray:
    """What one linear step from the priors' centres leaves of a run, in noise sd, shape (n,).

    The step makes the sum of sizes small, not of squares, so that one wild feature does not bend it
    (iteratively reweighted least squares).
    """
    line = problem.linearise(0, problem.start({}))
    sd = problem.runs[0].features.sd
    y, design = line.residual / sd, line.jacobian / sd[:, None]
    left = y
    for _ in range(_REWEIGHTED):
        weight = 1.0 / np.sqrt(np.maximum(np.abs(left), 1.0))
        rows = np.vstack([design * weight[:, None], np.eye(design.shape[1])])
        step = np.linalg.lstsq(rows, np.concatenate([y * weight, np.zeros(design.shape[1])]), rcond=None)[0]
        left = y - design @ step
    return np.asarray(left)


def _largest(change: FloatArray) -> float:
    """Largest size; what is no number any more has changed."""
    return float(np.max(np.where(np.isfinite(change), np.abs(change), np.inf), initial=0.0))

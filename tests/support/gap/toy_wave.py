"""A small model with scatter for the tests of the core: a decaying sequence of peaks.

Peak n of a run is a_n = a₀ Π r(1 + ε_k) with scatter ε; a second feature, a duration, is d = D·(1 + g a).
Effects: ``slope`` makes r depend on the amplitude, ``shift`` changes the durations, ``kick`` acts on
the first peak only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from daq_app.gap.core import (
    Confusion,
    Effect,
    FeatureSet,
    Label,
    Library,
    Parameter,
    Prediction,
    Run,
    Scatter,
)
from daq_app.gap.core.parameters import positive, signed
from daq_app.gap.own_model import Measured

PEAKS = 12


class DecayModel:
    """Each peak is predicted from the measured one before it, so that scatter does not accumulate."""

    name = "decay"
    scatters = (Scatter("scatter of r", 0.004, 0.7, "1"),)
    nuisance = (
        Parameter("r", 0.9, 0.02, "1", 0.5, 1.0),
        Parameter("D", 1.0, 0.05, "s", 0.5, 2.0),
    )

    def local_nuisance(self, run: Run) -> tuple[Parameter, ...]:
        return (Parameter("a0", 1.0, 0.5, "rad", 0.0, 5.0),)

    def predict(self, run: Run, values: Mapping[str, float]) -> Prediction:
        assert isinstance(run, Measured)
        measured = run.features.values[:PEAKS]
        before = np.concatenate([[values["a0"]], measured[:-1]])
        r = (
            values["r"]
            + values.get("slope.k", 0.0) * (before - 0.5)
            + values.get("step.h", 0.0) * (before > 0.5)
        )
        if "free.k0" in values:
            r = r + np.interp(before, np.linspace(0, 1, 5), [values[f"free.k{i}"] for i in range(5)])
        peaks = r * before
        peaks[0] = values["a0"] + values.get("kick.j", 0.0)
        durations = values["D"] * (1 + 0.3 * measured) + values.get("shift.s", 0.0) * measured**2
        loading = np.zeros((2 * PEAKS, PEAKS))
        loading[np.arange(1, PEAKS), np.arange(1, PEAKS)] = before[1:]
        return Prediction(np.concatenate([peaks, durations]), {"scatter of r": loading})


LIBRARY = Library(
    [
        Effect(
            "slope",
            "loss",
            (signed("k", 0.1),),
            "r + k (a − ½)",
            "test",
            confusable_with=(Confusion("shift", "durations"),),
        ),
        Effect("shift", "stiffness", (signed("s", 0.1, "s"),), "D + s a²", "test"),
        Effect("kick", "release", (replace(positive("j", 0.2, "rad"), per_run=True),), "a₁ + j", "test"),
        Effect("free", "loss", tuple(signed(f"k{i}", 0.06) for i in range(5)), "r(a)", "test", kind="probe"),
    ]
)


BEND = Effect("bend", "loss", (signed("c", 2.0),), "r + c (a − ½)²", "test", kind="departure", of=("slope",))
AGAIN = Effect(
    "again", "loss", (signed("k", 0.1),), "slope once more", "test", kind="departure", of=("slope",)
)


class BendingModel(DecayModel):
    """The toy with the departure, and with the slope a second time under another name."""

    def predict(self, run: Run, values: Mapping[str, float]) -> Prediction:
        slope = values.get("slope.k", 0.0) + values.get("again.k", 0.0)
        found = super().predict(run, {**values, "slope.k": slope})
        before = run.features.values[: PEAKS - 1]
        found.features[1:PEAKS] += values.get("bend.c", 0.0) * (before - 0.5) ** 2 * before
        return found


def make_runs(seed: int, count: int = 6, scatter: float = 0.004, **effects: float) -> list[Measured]:
    """Runs at three levels; `effects` as ``slope_k=0.03``, ``step_h=…``, ``bend_c=…`` (no effects)."""
    rng = np.random.default_rng(seed)
    r_true, d_true = 0.9 + 0.01 * rng.normal(), 1.0 + 0.02 * rng.normal()
    sd = np.concatenate([np.full(PEAKS, 1e-4), np.full(PEAKS, 1e-3)])
    runs = []
    for number in range(count):
        a = 0.5 + 0.2 * (number % 3) + 0.02 * rng.normal()
        peaks = [a]
        for _ in range(PEAKS - 1):
            r = r_true + effects.get("slope_k", 0.0) * (a - 0.5) + effects.get("step_h", 0.0) * (a > 0.5)
            r += effects.get("bend_c", 0.0) * (a - 0.5) ** 2
            a = a * r + a * scatter * rng.normal()
            peaks.append(a)
        true = np.array(peaks)
        durations = d_true * (1 + 0.3 * true) + effects.get("shift_s", 0.0) * true**2
        values = np.concatenate([true, durations]) + sd * rng.normal(size=2 * PEAKS)
        labels = tuple(
            Label("rotation", "swing", name, unit, float(true[i]), i / PEAKS)
            for name, unit in (("peak", "rad"), ("duration", "s"))
            for i in range(PEAKS)
        )
        runs.append(Measured(f"run {number}", f"L{number % 3}", FeatureSet(values, sd, labels)))
    return runs

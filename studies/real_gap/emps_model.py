"""The EMPS drive as a model for the gap diagnosis: M q̈ + offset = force, and what that lacks.

Data and published parameters: Janot, Gautier, Brunot, "Data set and reference models of EMPS"
(nonlinearbenchmark.org). The features are samples of the motor force, low-passed and decimated
(the residual of a force equation, linear in its parameters), so that nothing has to be simulated.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.signal import butter, filtfilt

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
from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.parameters import positive, signed
from daq_app.gap.own_model import Measured

RATE_HZ = 1000.0
STATE_CUTOFF_HZ = 80.0
FORCE_CUTOFF_HZ = 20.0
DECIMATION = 10
EDGE_SAMPLES = 200
SEGMENTS = 4
SLOW_M_S = 1e-3
"""Below this speed the drive is taken as standing: there Coulomb's force is anything up to Fc."""
PROBE_SPEEDS = 7
SCREW_PITCH_M = 0.01


@dataclass(frozen=True, slots=True)
class Motion:
    """Filtered motion of one record, each of shape (n,): m, m/s, m/s², N, and time in s."""

    time_s: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    force: FloatArray


def load_motion(path: Path) -> Motion:
    """One EMPS record: the measured position differentiated twice after a zero-phase low-pass."""
    data = loadmat(path)
    position = data["qm"].ravel().astype(float)
    force = float(data["gtau"].item()) * data["vir"].ravel().astype(float)
    time_s = data["t"].ravel().astype(float)
    position = filtfilt(*butter(4, STATE_CUTOFF_HZ, fs=RATE_HZ), position)
    velocity = np.gradient(position, 1 / RATE_HZ)
    return Motion(time_s, position, velocity, np.gradient(velocity, 1 / RATE_HZ), force)


def smooth(values: FloatArray) -> FloatArray:
    """The same low-pass for the force and for every regressor, so that no phase comes between them."""
    filtered: FloatArray = filtfilt(*butter(4, FORCE_CUTOFF_HZ, fs=RATE_HZ), values)
    return filtered


def load_runs(path: Path, noise_n: float = 0.5) -> list[Measured]:
    """The record cut into `SEGMENTS` runs; the level is the record's name, so whole records are held out.

    `noise_n`: force noise of the feature alone; what exceeds it is estimated as scatter.
    """
    motion = load_motion(path)
    force = smooth(motion.force)
    ends = np.linspace(EDGE_SAMPLES, motion.force.size - EDGE_SAMPLES, SEGMENTS + 1).astype(int)
    runs = []
    for number, (start, stop) in enumerate(itertools.pairwise(ends), 1):
        pick = np.arange(start, stop, DECIMATION)
        labels = tuple(
            Label(
                "motor force",
                _phase(motion, k),
                "force residual",
                "N",
                float(motion.velocity[k]),
                i / pick.size,
            )
            for i, k in enumerate(pick)
        )
        features = FeatureSet(force[pick], np.full(pick.size, noise_n), labels)
        inputs = {"motion": motion, "pick": pick, "cache": {}}
        runs.append(Measured(f"{path.stem}/{number}", path.stem, features, inputs))
    return runs


def _phase(motion: Motion, k: int) -> str:
    if abs(motion.velocity[k]) < SLOW_M_S:
        return "standing"
    speeding_up = motion.velocity[k] * motion.acceleration[k] > 0
    return "accelerating" if speeding_up else "braking"


class EmpsModel:
    """M q̈ + offset = F, plus the effects of a hypothesis. Baseline: mass (and viscous friction if asked)."""

    name = "EMPS drive"

    def __init__(self, *, viscous_in_baseline: bool = False) -> None:
        self.viscous_in_baseline = viscous_in_baseline
        self.scatters = (Scatter("unexplained force", 1.0, 1.5, "N", "what the model leaves per sample"),)

    @property
    def nuisance(self) -> tuple[Parameter, ...]:
        """Vague priors: the drive was not surveyed."""
        known = (
            Parameter("M", 90.0, 20.0, "kg", 1.0, 500.0, meaning="inertia, as seen by the motor force"),
            Parameter("offset", 0.0, 5.0, "N", meaning="offset of the current loop"),
        )
        viscous = Parameter("Fv", 200.0, 100.0, "N s/m", 0.0, 2000.0, meaning="viscous friction")
        return (*known, viscous) if self.viscous_in_baseline else known

    def local_nuisance(self, run: Run) -> tuple[Parameter, ...]:
        return ()

    def predict(self, run: Run, values: Mapping[str, float]) -> Prediction:
        assert isinstance(run, Measured)
        motion: Motion = run.inputs["motion"]
        pick = run.inputs["pick"]
        v, x = motion.velocity, motion.position

        def term(key: str, regressor: Callable[[], FloatArray]) -> FloatArray:
            """A regressor after the low-pass at the run's samples, computed once per run."""
            cache: dict[str, FloatArray] = run.inputs["cache"]
            if key not in cache:
                cache[key] = smooth(regressor())[pick]
            return cache[key]

        def wave(function: Callable[[FloatArray], FloatArray]) -> FloatArray:
            return function(2 * np.pi * x / SCREW_PITCH_M)

        regressors: dict[str, Callable[[], FloatArray]] = {
            "M": lambda: motion.acceleration,
            "offset": lambda: np.ones_like(v),
            "Fv": lambda: v,
            "viscous.Fv": lambda: v,
            "coulomb.Fc": lambda: np.sign(v) * (np.abs(v) > SLOW_M_S / 10),
            "quadratic.c": lambda: v * np.abs(v),
            "asymmetry.d": lambda: np.maximum(v, 0.0),
            "stiffness.k": lambda: x - x.mean(),
            "position_ripple.A": lambda: wave(np.cos),
            "position_ripple.B": lambda: wave(np.sin),
            "force_lag.tau": lambda: -np.gradient(smooth(motion.force), 1 / RATE_HZ),
        }
        for i in range(PROBE_SPEEDS):
            regressors[f"friction_probe.k{i}"] = partial(_hat, v, i)
        force = np.zeros(pick.size)
        for key, value in values.items():
            force = force + value * term(key, regressors[key])
        return Prediction(force, {"unexplained force": np.ones(force.size)})


def _hat(velocity: FloatArray, knot: int) -> FloatArray:
    """Piecewise linear basis over |v| (odd in v) with knots at 0 … 0.14 m/s."""
    grid = np.linspace(0.0, 0.14, PROBE_SPEEDS)
    weights = np.zeros(PROBE_SPEEDS)
    weights[knot] = 1.0
    values: FloatArray = np.sign(velocity) * np.interp(np.abs(velocity), grid, weights)
    return values


def library(*, with_viscous: bool = True) -> Library:
    """What a positioning drive may lack, with generous ranges that cover its 60 N of force."""
    friction = "another speed range"
    effects = [
        Effect(
            "viscous",
            "friction",
            (positive("Fv", 600.0, "N s/m", "viscous friction"),),
            "F = … + Fv q̇",
            "Olsson et al., Friction models and friction compensation, 1998",
            "force in step with speed",
            (Confusion("coulomb", friction),),
        ),
        Effect(
            "coulomb",
            "friction",
            (positive("Fc", 60.0, "N", "dry friction"),),
            "F = … + Fc sign q̇",
            "Olsson et al., 1998",
            "force of one size whatever the speed",
            (Confusion("viscous", friction),),
        ),
        Effect(
            "quadratic",
            "friction",
            (positive("c", 4000.0, "N s²/m²"),),
            "F = … + c q̇|q̇|",
            "Olsson et al., 1998",
            "force with the square of speed",
            (Confusion("viscous", friction),),
        ),
        Effect(
            "asymmetry",
            "friction",
            (signed("d", 400.0, "N s/m"),),
            "F = … + d max(q̇, 0)",
            "Janot et al., EMPS report",
            "one direction loses more",
        ),
        Effect(
            "stiffness",
            "restoring",
            (signed("k", 300.0, "N/m"),),
            "F = … + k (q − q̄)",
            "cable or hose that pulls",
            "force in step with position",
        ),
        Effect(
            "position_ripple",
            "restoring",
            (signed("A", 10.0, "N"), signed("B", 10.0, "N")),
            "F = … + A cos(2πq/λ) + B sin(2πq/λ), λ = 10 mm",
            "ball screw's pitch, motor cogging",
            "force over position",
        ),
        Effect(
            "force_lag",
            "sensor",
            (signed("tau", 0.02, "s"),),
            "F measured = F − τ Ḟ",
            "current-loop delay",
            "error at changes of force",
        ),
        Effect(
            "friction_probe",
            "friction",
            tuple(
                signed(f"k{i}", 80.0, "N", f"friction force at {0.14 * i / (PROBE_SPEEDS - 1):.3f} m/s")
                for i in range(PROBE_SPEEDS)
            ),
            "F = … + f(|q̇|) sign q̇, f piecewise linear",
            "non-parametric",
            kind="probe",
        ),
    ]
    whole = Library(effects)
    return whole if with_viscous else whole.without("viscous")

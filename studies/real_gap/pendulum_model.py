"""A free-swinging rod released by hand, as a model for the gap diagnosis.

Recordings: rotary-inverted-pendulum (J. Benard, MIT), encoder angle in degrees, 1 kHz, 5 s, hanging at 0.
Two models. `PendulumModel` works on the angular acceleration (a torque balance, linear in what is
unknown), which says *which* effect is missing. `TraceModel` integrates the motion from after the
release and says *how far* the gap shrinks in degrees.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
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
from sim_hardware.jit import kernel

RATE_HZ = 1000.0
CUTOFF_HZ = 8.0
DECIMATION = 10
HAND_KNOTS_S = (0.0, 0.08, 0.16, 0.24, 0.32, 0.40, 0.48, 0.56)
"""The hand's torque is piecewise linear between these times and zero after the last."""
TRACE_STEP = 20
"""Samples between features of a trace (20 ms)."""


def load_angle(path: Path) -> FloatArray:
    """Angle in rad, 0 hanging."""
    degrees = np.loadtxt(path, skiprows=2)
    return np.deg2rad(degrees)


def turning_points(angle: FloatArray) -> list[int]:
    """Samples at which the smoothed rotation reverses."""
    smooth = filtfilt(*butter(2, 30.0, fs=RATE_HZ), angle)
    return [int(k) + 1 for k in np.flatnonzero(np.diff(np.sign(np.diff(smooth))))]


def load_runs(paths: Sequence[Path]) -> list[Measured]:
    """Features: angular acceleration (rad/s²) every 10 ms, of the whole record with the hand's part."""
    runs = []
    for path in paths:
        raw = load_angle(path)
        low_pass = butter(3, CUTOFF_HZ, fs=RATE_HZ)
        # What the filter does to the acceleration it must do to sin θ and to every other term too.
        velocity_raw = np.gradient(filtfilt(*butter(2, 60.0, fs=RATE_HZ), raw), 1 / RATE_HZ)
        acceleration = np.gradient(filtfilt(*low_pass, velocity_raw), 1 / RATE_HZ)
        first = turning_points(raw)[0]
        pick = np.arange(20, raw.size - 100, DECIMATION)
        labels = tuple(
            Label(
                "encoder",
                _phase(int(k), first),
                "angular acceleration",
                "rad/s²",
                float(raw[k]),
                k / raw.size,
            )
            for k in pick
        )
        features = FeatureSet(acceleration[pick], np.full(pick.size, 0.05), labels)
        inputs = {
            "raw": raw,
            "velocity": velocity_raw,
            "low_pass": low_pass,
            "pick": pick,
            "cache": {},
            "first": first,
        }
        runs.append(Measured(path.stem, path.stem, features, inputs))
    return runs


def _phase(sample: int, first_turn: int) -> str:
    if sample < first_turn + 60:
        return "release"
    return "swing"


class PendulumModel:
    """θ̈ = −ω₀² sin(θ − θ₀) − c θ̇, with unknown ω₀², c and zero of the encoder."""

    name = "free-swinging pendulum"
    scatters = (Scatter("unexplained acceleration", 0.5, 1.5, "rad/s²"),)
    nuisance = (
        Parameter("omega2", 100.0, 30.0, "rad²/s²", 1.0, 1000.0, meaning="gravity over reduced length"),
        Parameter("c", 0.3, 0.5, "1/s", 0.0, 10.0, meaning="viscous damping"),
    )

    def local_nuisance(self, run: Run) -> tuple[Parameter, ...]:
        return (Parameter("zero", 0.0, 0.03, "rad", meaning="encoder angle when hanging"),)

    def predict(self, run: Run, values: Mapping[str, float]) -> Prediction:
        assert isinstance(run, Measured)
        angle, velocity = run.inputs["raw"], run.inputs["velocity"]

        def term(key: str, regressor: FloatArray | None = None) -> FloatArray:
            cache: dict[str, FloatArray] = run.inputs["cache"]
            if key not in cache:
                full = _regressor(key, angle, velocity) if regressor is None else regressor
                cache[key] = filtfilt(*run.inputs["low_pass"], full)[run.inputs["pick"]]
            return cache[key]

        # sin(θ − θ₀) = sin θ cos θ₀ − cos θ sin θ₀: exact, and filtered once.
        zero = values["zero"]
        total = -values["omega2"] * (term("sin") * np.cos(zero) - term("cos") * np.sin(zero))
        total = total - values["c"] * term("velocity")
        for key, value in values.items():
            if "." in key:
                total = total - value * term(key)
        return Prediction(total, {"unexplained acceleration": np.ones(total.size)})


def _regressor(key: str, angle: FloatArray, velocity: FloatArray) -> FloatArray:
    """Time series that a parameter multiplies (before the low-pass)."""
    if key.startswith("hand."):
        knot = int(key.removeprefix("hand.h"))
        heights = np.zeros(len(HAND_KNOTS_S) + 1)
        heights[knot] = 1.0
        times = [*HAND_KNOTS_S, HAND_KNOTS_S[-1] + 0.08]
        hat: FloatArray = np.interp(np.arange(angle.size) / RATE_HZ, times, heights)
        return hat
    if key.startswith("damping_probe."):
        knot = int(key.removeprefix("damping_probe.k"))
        heights = np.zeros(6)
        heights[knot] = 1.0
        return np.asarray(np.sign(velocity) * np.interp(np.abs(velocity), np.linspace(0, 18, 6), heights))
    shapes: dict[str, Callable[[], FloatArray]] = {
        "sin": lambda: np.sin(angle),
        "cos": lambda: np.cos(angle),
        "velocity": lambda: velocity,
        "quadratic.q": lambda: velocity * np.abs(velocity),
        "coulomb.f": lambda: np.sign(velocity),
        "spring.k": lambda: angle,
        "second_harmonic.s": lambda: np.sin(2 * angle),
        "gain.g": lambda: angle * np.cos(angle) - np.sin(angle),
    }
    return shapes[key]()


def library() -> Library:
    """What a swinging rod may lack beyond gravity and viscous damping."""
    levels = "a larger range of amplitudes"
    return Library(
        [
            Effect(
                "quadratic",
                "dissipation",
                (signed("q", 0.2, "1/rad", "drag over inertia"),),
                "θ̈ ∋ −q θ̇|θ̇|",
                "air drag",
                "peaks fall faster at large amplitude",
                (Confusion("coulomb", levels),),
            ),
            Effect(
                "coulomb",
                "dissipation",
                (signed("f", 4.0, "rad/s²", "dry friction over inertia"),),
                "θ̈ ∋ −f sign θ̇",
                "bearing friction",
                "peaks fall in a straight line",
                (Confusion("quadratic", levels),),
            ),
            Effect("spring", "restoring", (signed("k", 20.0, "1/s²"),), "θ̈ ∋ −k θ", "cable of the encoder"),
            Effect(
                "second_harmonic", "restoring", (signed("s", 10.0, "1/s²"),), "θ̈ ∋ −s sin 2θ", "magnetic rest"
            ),
            Effect("gain", "sensor", (signed("g", 10.0),), "θ measured = (1 + g/ω₀²) θ", "encoder scale"),
            Effect(
                "hand",
                "release",
                tuple(
                    replace(signed(f"h{i}", 200.0, "rad/s²", f"at {t:.2f} s"), per_run=True)
                    for i, t in enumerate(HAND_KNOTS_S)
                ),
                "θ̈ ∋ −h(t) before 0.64 s, h piecewise linear, its own in every run",
                "the recording starts while the rod is raised by hand",
                "acceleration that gravity does not give, at the start only",
            ),
            Effect(
                "damping_probe",
                "dissipation",
                tuple(signed(f"k{i}", 8.0, "rad/s²", f"at {3.6 * i:.1f} rad/s") for i in range(6)),
                "θ̈ ∋ −d(|θ̇|) sign θ̇, d piecewise linear",
                "non-parametric",
                kind="probe",
            ),
        ]
    )


@kernel
def _swing(
    theta: float, omega: float, w2: float, c: float, q: float, f: float, n: int, every: int
) -> np.ndarray:
    """Angle every `every` ms by RK4 at 1 ms."""
    out = np.empty(n)
    h = 1e-3
    for i in range(n):
        out[i] = theta
        for _ in range(every):
            k1v = -w2 * np.sin(theta) - c * omega - q * omega * abs(omega) - f * np.tanh(omega / 0.05)
            a, b = theta + 0.5 * h * omega, omega + 0.5 * h * k1v
            k2v = -w2 * np.sin(a) - c * b - q * b * abs(b) - f * np.tanh(b / 0.05)
            a2, b2 = theta + 0.5 * h * b, omega + 0.5 * h * k2v
            k3v = -w2 * np.sin(a2) - c * b2 - q * b2 * abs(b2) - f * np.tanh(b2 / 0.05)
            a3, b3 = theta + h * b2, omega + h * k3v
            k4v = -w2 * np.sin(a3) - c * b3 - q * b3 * abs(b3) - f * np.tanh(b3 / 0.05)
            theta += h / 6 * (omega + 2 * b + 2 * b2 + b3)
            omega += h / 6 * (k1v + 2 * k2v + 2 * k3v + k4v)
    return out


class TraceModel:
    """The angle itself, integrated from the second turning point on (the hand has let go by then)."""

    name = "free swing, trace"
    scatters = (Scatter("unexplained angle", 0.02, 1.5, "rad"),)

    def __init__(self, *, viscous_in_baseline: bool = False) -> None:
        self.viscous_in_baseline = viscous_in_baseline

    @property
    def nuisance(self) -> tuple[Parameter, ...]:
        known = (
            Parameter("omega2", 110.0, 20.0, "rad²/s²", 1.0, 1000.0, meaning="gravity over reduced length"),
        )
        damping = Parameter("c", 0.3, 0.3, "1/s", 0.0, 5.0, meaning="viscous damping")
        return (*known, damping) if self.viscous_in_baseline else known

    def local_nuisance(self, run: Run) -> tuple[Parameter, ...]:
        assert isinstance(run, Measured)
        return (
            Parameter("theta0", run.inputs["start"], 0.05, "rad"),
            Parameter("omega0", 0.0, 0.5, "rad/s"),
            Parameter("zero", 0.0, 0.03, "rad"),
        )

    def predict(self, run: Run, values: Mapping[str, float]) -> Prediction:
        angle = values["zero"] + _swing(
            values["theta0"] - values["zero"],
            values["omega0"],
            values["omega2"],
            values.get("c", 0.0) + values.get("viscous.c", 0.0),
            values.get("quadratic.q", 0.0),
            values.get("coulomb.f", 0.0),
            len(run.features),
            TRACE_STEP,
        )
        return Prediction(angle, {"unexplained angle": np.ones(angle.size)})


TRACE_EFFECTS = Library(
    [
        Effect("viscous", "dissipation", (positive("c", 1.0, "1/s"),), "θ̈ ∋ −c θ̇", "bearing"),
        Effect("quadratic", "dissipation", (positive("q", 0.2, "1/rad"),), "θ̈ ∋ −q θ̇|θ̇|", "air drag"),
        Effect("coulomb", "dissipation", (positive("f", 4.0, "rad/s²"),), "θ̈ ∋ −f sign θ̇", "bearing"),
    ]
)


def load_traces(paths: Sequence[Path]) -> list[Measured]:
    """Features: the angle every 20 ms from the second turning point on."""
    runs = []
    for path in paths:
        raw = load_angle(path)
        start = turning_points(raw)[1]
        angle = raw[start::TRACE_STEP]
        labels = tuple(
            Label("encoder", "swing", "angle", "rad", float(a), i / angle.size) for i, a in enumerate(angle)
        )
        features = FeatureSet(angle, np.full(angle.size, np.deg2rad(0.09) / np.sqrt(12)), labels, 0.1)
        runs.append(Measured(path.stem, path.stem, features, {"start": float(raw[start])}))
    return runs

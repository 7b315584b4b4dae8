"""Two tanks in cascade as a model for the gap diagnosis: √-law outlets and a pump, and what that lacks.

Data: Schoukens, Mattson, Wigren, Noël, "Cascaded tanks benchmark combining soft and hard nonlinearities"
(nonlinearbenchmark.org): the level of the lower tank in volts of its sensor, the pump's voltage, 4 s apart,
1024 samples in each of two records. The publication says what the √-law lacks: the upper tank runs over,
and a part of what runs over falls into the lower one.

Levels are in volts of the lower tank's sensor, the upper tank in units that make both tanks of one area:

    ẋ₁ = k₄ u − k₁ √x₁          ẋ₂ = k₁ √x₁ − k₃ √x₂          y = x₂

The features are rises of the measured level over 20 s. The upper level is simulated from the pump alone; the
lower starts each time from what was measured, so that errors do not add up along the record. Blocks that
touch 10 V are left out: there the sensor (or the tank) is full.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numba
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
from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.parameters import between, positive, signed
from daq_app.gap.own_model import Measured

STEP_S = 4.0
BLOCK = 5
"""Samples from the beginning of a rise to its end."""
SUBSTEPS = 8
FULL_V = 9.995
NOISE_V = 0.02
"""Noise of one reading of the level, V."""
PROBE_LEVELS_V = (0.0, 3.0, 6.0, 9.0, 12.0, 15.0)
_NO_LIMIT = 1e9
_RECORDS = (("estimation", 0, 2), ("validation", 1, 3))


def load_runs(path: Path) -> list[Measured]:
    """The two records of ``dataBenchmark.csv``, each a run and a level of its own."""
    table = np.genfromtxt(path, delimiter=",", skip_header=1, usecols=(0, 1, 2, 3), invalid_raise=False)
    table = table[np.isfinite(table).all(axis=1)]
    return [_run(name, table[:, pump], table[:, level]) for name, pump, level in _RECORDS]


def _run(name: str, pump_v: FloatArray, level_v: FloatArray) -> Measured:
    starts = np.arange(0, level_v.size - BLOCK, BLOCK)
    starts = starts[(level_v[starts] < FULL_V) & (level_v[starts + BLOCK] < FULL_V)]
    rises = level_v[starts + BLOCK] - level_v[starts]
    labels = tuple(
        Label(
            "lower level",
            "filling" if rise > 0 else "draining",
            "rise in 20 s",
            "V",
            float(level_v[k]),
            float(k / level_v.size),
        )
        for k, rise in zip(starts, rises, strict=True)
    )
    features = FeatureSet(rises, np.full(rises.size, np.sqrt(2.0) * NOISE_V), labels)
    return Measured(name, name, features, {"pump": pump_v, "level": level_v, "starts": starts})


class TanksModel:
    """Outlets that obey Torricelli's law and a pump in proportion to its voltage."""

    name = "cascaded tanks"
    scatters = (Scatter("unexplained rise", 0.1, 1.5, "V", "what the model leaves per block"),)
    nuisance = (
        between("k1", 0.01, 0.3, "√V/s", "outlet of the upper tank"),
        between("k3", 0.01, 0.3, "√V/s", "outlet of the lower tank"),
        between("k4", 0.01, 0.3, "1/s", "pump"),
    )

    def local_nuisance(self, run: Run) -> tuple[Parameter, ...]:
        return (between("x1_start", 1.0, 15.0, "V", "upper level at the beginning"),)

    def predict(self, run: Run, values: Mapping[str, float]) -> Prediction:
        assert isinstance(run, Measured)
        get = values.get
        pump = get("pump_curve.q", 0.0) * run.inputs["pump"] ** 2 + run.inputs["pump"]
        pump = np.maximum(pump - get("pump_dead_band.u0", 0.0), 0.0)
        extra = np.array([get(f"inflow_probe.k{i}", 0.0) for i in range(len(PROBE_LEVELS_V))])
        rises = _rises(
            pump,
            run.inputs["level"],
            run.inputs["starts"],
            np.array([values["k1"], values["k3"], values["k4"], values["x1_start"]]),
            np.array(
                [
                    get("overflow.level", _NO_LIMIT),
                    get("overflow.share", 0.0),
                    0.5 + get("outlet_exponent.e", 0.0),
                    get("leak.l", 0.0),
                    get("level_curve.g", 0.0),
                ]
            ),
            np.array(PROBE_LEVELS_V),
            extra,
        )
        return Prediction(rises, {"unexplained rise": np.ones(rises.size)})


@numba.njit(cache=True)
def _rises(  # type: ignore[no-untyped-def]
    pump, level, starts, outlets, lacks, probe_levels, probe_inflow
):
    """Rise of the lower level over each block, (n_blocks,); the midpoint rule at STEP_S / SUBSTEPS."""
    k1, k3, k4, x1 = outlets
    limit, share, exponent, leak, curve = lacks
    h = STEP_S / SUBSTEPS
    rises = np.empty(starts.size)
    n = 0
    x2, begin = 0.0, 0.0
    for k in range(level.size):
        if n > 0 and k == starts[n - 1] + BLOCK:
            rises[n - 1] = (x2 + curve * x2**2) - begin
        if n < starts.size and k == starts[n]:
            begin = level[k]
            x2 = begin - curve * begin**2
            n += 1
        if k + 1 == level.size:
            break
        for j in range(SUBSTEPS):
            u = pump[k] + (pump[k + 1] - pump[k]) * (j + 0.5) / SUBSTEPS
            out = k1 * max(x1, 0.0) ** exponent
            middle = max(x1 + 0.5 * h * (k4 * u - out - leak * x1), 0.0)
            out = k1 * middle**exponent
            spilled = 0.0
            x1 = max(x1 + h * (k4 * u - out - leak * middle), 0.0)
            if x1 > limit:
                spilled = (x1 - limit) / h
                x1 = limit
            inflow = out + share * spilled + np.interp(middle, probe_levels, probe_inflow)
            half = max(x2 + 0.5 * h * (inflow - k3 * np.sqrt(max(x2, 0.0))), 0.0)
            x2 = max(x2 + h * (inflow - k3 * np.sqrt(half)), 0.0)
    return rises


def library() -> Library:
    """What a pair of tanks may lack."""
    higher = "a record in which the upper tank is fuller"
    return Library(
        [
            Effect(
                "overflow",
                "hydraulics",
                (
                    between("level", 3.0, 20.0, "V", "upper level at which it runs over"),
                    Parameter(
                        "share", 0.5, 0.5, "", 0.0, 1.0, meaning="share that falls into the lower tank"
                    ),
                ),
                "x₁ ≤ h; ẋ₂ ∋ s · (what runs over)",
                "Schoukens, Mattson, Wigren, Noël, Cascaded tanks benchmark, 2016",
                "the lower level jumps when the upper tank is full",
                (Confusion("inflow_probe", higher),),
            ),
            Effect(
                "outlet_exponent",
                "hydraulics",
                (signed("e", 0.3, "", "exponent beyond ½"),),
                "outflow = k₁ x₁^(½+e)",
                "flow through a short pipe instead of an orifice",
                "draining follows another law",
            ),
            Effect(
                "leak",
                "hydraulics",
                (positive("l", 0.02, "1/s", "loss in proportion to the level"),),
                "ẋ₁ ∋ −l x₁",
                "a leaking tank",
                "less arrives below than is pumped",
            ),
            Effect(
                "pump_curve",
                "pump",
                (signed("q", 0.2, "1/V", "curvature of the pump"),),
                "inflow = k₄ (u + q u²)",
                "pump characteristic",
                "error in step with the square of the voltage",
            ),
            Effect(
                "pump_dead_band",
                "pump",
                (positive("u0", 0.5, "V", "voltage at which water begins to come"),),
                "inflow = k₄ max(u − u₀, 0)",
                "pump characteristic",
                "error at low voltage",
            ),
            Effect(
                "level_curve",
                "sensor",
                (signed("g", 0.02, "1/V", "curvature of the level sensor"),),
                "y = x₂ + g x₂²",
                "capacitive level sensor",
                "error with the level itself",
            ),
            Effect(
                "inflow_probe",
                "hydraulics",
                tuple(
                    signed(f"k{i}", 0.2, "V/s", f"at {level:g} V") for i, level in enumerate(PROBE_LEVELS_V)
                ),
                "ẋ₂ ∋ f(x₁), f piecewise linear",
                "non-parametric",
                "inflow that the outlet of the upper tank does not give",
                kind="probe",
            ),
        ]
    )

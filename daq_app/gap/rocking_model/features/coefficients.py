"""Predicted coefficients of all blocks of a run, by the rule of each block."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache, partial

import numpy as np

from daq_app.gap.core import Parameter
from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.parameters import known
from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.features.channel_response import channel
from daq_app.gap.rocking_model.features.families import sensor_families
from daq_app.gap.rocking_model.features.family import CROSSTALK_SHARE, Predict, Size
from daq_app.gap.rocking_model.features.oscillations.ring_response import bending, turning
from daq_app.gap.rocking_model.features.response import electronics
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.records import Survey
from daq_app.gap.rocking_model.tolerances.sensors import CROSSTALK, ELECTRONICS_S

BIAS = "bias_"
"""Prefix of the parameters that say what sound sensors may be off by in all runs."""
_RINGS = ("bending", "turning")


def _release(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """Speed away from upright at the release."""
    pushed = values.get("initial_velocity.omega", 0.0) + values.get("initial_velocity.own", 0.0)
    return np.array([values["omega0"] + pushed])


def _floor(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """The sinusoid of the floor while the wall does not move."""
    sizes = {
        "amplitude": values.get("ambient.amplitude", 0.0),
        "frequency": values.get("ambient.fitted", run.vibration.frequency_hz if run.vibration else 0.0),
    }
    return np.array([sizes[name] for name in block.names])


@cache
def _rules() -> Mapping[str, Predict]:
    rules: dict[str, Predict] = {
        "channel": channel,
        "bending": bending,
        "turning": turning,
        "floor": _floor,
        "release": _release,
    }
    for family in sensor_families():
        rules |= family.predict
    return rules


@cache
def sizes() -> Mapping[tuple[str, str], Size]:
    """How every coefficient of the sensor families repeats, by (block, coefficient)."""
    return {key: size for family in sensor_families() for key, size in family.sizes.items()}


def block_coefficients(run: RockingRun, values: Mapping[str, float]) -> FloatArray:
    """Predicted coefficients of all blocks of a run, (k,)."""
    predicted = [
        run.cache.part(place, values, partial(_coefficients, run, block))
        for place, block in enumerate(run.blocks)
    ]
    return np.concatenate(predicted) if predicted else np.zeros(0)


def units(run: RockingRun) -> list[FloatArray]:
    """Units of the scatter of the coefficients of each block of a run, (k,) each."""
    return run.cache.constant(
        "units",
        lambda: [
            np.array([repeatability(block, i) for i in range(len(block.names))]) for block in run.blocks
        ],
    )


def _coefficients(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    coefficients = _rules()[block.rule](run, block, values)
    for i, name in _bias_names(block.family, block.names):
        coefficients[i] += values.get(name, 0.0)
    for name, loading in block.systematic.items():
        coefficients = coefficients + values.get(name, 0.0) * loading
    return coefficients


def repeatability(block: Block, i: int) -> float:
    """Unit in which a coefficient scatters from run to run; 0 for what does not."""
    if block.rule == "channel":
        return 0.1 * float(np.sqrt(block.covariance[i, i])) if i == len(block.names) - 1 else 0.0
    size = sizes().get((block.family, block.names[i]))
    return size.scatter if size is not None else 0.0


@cache
def _bias_names(family: str, coefficients: tuple[str, ...]) -> tuple[tuple[int, str], ...]:
    """(place, name of the parameter) of those coefficients of a block that have a bias."""
    return tuple(
        (i, _bias_name(family, coefficient))
        for i, coefficient in enumerate(coefficients)
        if (size := sizes().get((family, coefficient))) is not None and size.bias > 0.0
    )


def _bias_name(family: str, coefficient: str) -> str:
    return f"{BIAS}{family}_{coefficient}".replace(" ", "_")


def sensor_priors(survey: Survey) -> tuple[Parameter, ...]:
    """Parameters of all sensor families: calibrations, and what sound sensors may be off by in all runs.

    A bias is what a certificate lets pass and a regression cannot avoid, the same in all runs; an effect on a
    sensor thus counts as far as it exceeds what sound sensors do.
    """
    family_priors = (parameter for family in sensor_families() for parameter in family.priors(survey))
    biases = (
        known(
            _bias_name(family, coefficient),
            size.bias,
            size.unit,
            f"what sound sensors may be off by: {coefficient} of {family}",
        )
        for (family, coefficient), size in sizes().items()
        if size.bias > 0.0
    )
    unequal = (known(f"{name}_unequal", 1.0, "1", f"{name} from unequal accelerometers") for name in _RINGS)
    late = (
        replace(
            known(electronics(family), ELECTRONICS_S, "s", f"delay of the {family}s behind the LVDTs"),
            usual_of=f"lag@{family}",
        )
        for family in ("wire", "accelerometer")
    )
    shared = Parameter(
        CROSSTALK_SHARE, 0.0, CROSSTALK, "1", meaning="crosstalk from the channel scanned before"
    )
    return (*family_priors, *biases, *unequal, *late, shared)

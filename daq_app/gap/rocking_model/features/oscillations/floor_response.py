"""Predicted vibration of the floor."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.features.rocking_run import RockingRun


def floor(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """The sinusoid of the floor while the wall does not move."""
    sizes = {
        "amplitude": values.get("ambient.amplitude", 0.0),
        "frequency": values.get("ambient.fitted", run.vibration.frequency_hz if run.vibration else 0.0),
    }
    return np.array([sizes[name] for name in block.names])


def with_measured_inputs(run: RockingRun, values: Mapping[str, float]) -> Mapping[str, float]:
    """The values with what is not fitted but read from the run itself: the floor's frequency and phase."""
    if "ambient.amplitude" not in values or run.vibration is None:
        return values
    seen = run.vibration
    given = {**values, "ambient.frequency": seen.frequency_hz}
    given["ambient.phase"] = seen.phase + seen.phase_sd * values.get("ambient.shift", 0.0)
    if "ambient.frequency" in values:
        given["ambient.fitted"] = values["ambient.frequency"]
    return given

"""Derived signals and results of a run, from its journal: rotation, velocity, θ0, impacts, r."""

from __future__ import annotations

import numpy as np

from daq_app.rocking.live import Estimate, LiveAnalyser
from daq_app.runfile import DerivedData, DerivedSignal, JournalContents
from daq_app.runfile.source import rig_of

_WINDOW = 4000


def derive(contents: JournalContents) -> tuple[DerivedData | None, str]:
    """Derived data, and a sentence where there are none (empty otherwise). Never raises."""
    if contents.n_samples == 0:
        return None, ""
    rig = rig_of(contents.header)
    if rig is None:
        return None, "The run's rig file is not understood, so nothing was derived"
    header = contents.header
    try:
        analyser = LiveAnalyser(rig, header.rate_hz, header.tare)
        rotations, velocities = [], []
        estimate: Estimate | None = None
        for first, window in contents.windows(_WINDOW):
            result = analyser.process(first, window)
            rotations.append(result.rotation_rad)
            velocities.append(result.velocity_rad_s)
            estimate = result.estimate or estimate
    except Exception as error:
        return None, f"The analysis failed ({type(error).__name__}: {error}); the readings are complete"
    signals = {
        "rotation": DerivedSignal(np.concatenate(rotations), "rad", "rotation of the wall about its base"),
        "velocity": DerivedSignal(np.concatenate(velocities), "rad/s", "angular velocity"),
    }
    results: dict[str, object] = {"filter": analyser.velocity_filter.statement}
    if estimate is not None:
        results = {**results, "estimate": estimate.as_message(), "alpha_rad": rig.specimen.alpha0_rad}
    return DerivedData(contents.first_sample, signals, results=results), ""

"""Derived signals and results of a run, for files of other programs: the numbers that `analyse` prints."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from daq_app.runfile import DerivedData, DerivedSignal

if TYPE_CHECKING:
    from daq_app.rocking import TestAnalysis
    from daq_app.runfile import Run

_PHASES: Final = "0 before the release, 1 falling, 2 rocking (from the first impact), 3 at rest"


def derived_of(run: Run) -> DerivedData | None:
    """Rotation, velocity, phase and results of a run; None where it shows no test or knows no rig."""
    from daq_app.rocking import TestRecord, analyse_record

    if run.rig is None:
        return None
    record = TestRecord.from_run(run, run.rig)
    try:
        analysis = analyse_record(record)
    except ValueError:
        return None
    if not analysis.found or analysis.series is None:
        return None
    series = analysis.series
    signals = {
        "rotation": DerivedSignal(series.rotation_rad, "rad", "rotation of the wall"),
        "velocity": DerivedSignal(series.velocity_rad_s, "rad/s", "angular velocity, filtered derivative"),
        "phase": DerivedSignal(_phases(analysis, series.time_s), "1", f"phase of the test: {_PHASES}"),
        "half_cycle": DerivedSignal(_half_cycle(analysis, series.time_s), "1", "number of impacts so far"),
        "rotation_fused": DerivedSignal(series.best_rotation_rad, "rad", "rotation from wires and LVDTs"),
        "neutral_axis": DerivedSignal(series.neutral_axis_m, "m", "x of zero opening of the base joint"),
    }
    return DerivedData(record.first_sample, signals, results={"analysis": analysis.as_dict()})


def _half_cycle(analysis: TestAnalysis, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    impacts = [cycle.start_s for cycle in analysis.half_cycles[1:]]
    return np.searchsorted(np.array(impacts), time_s, side="right").astype(np.float64)


def _phases(analysis: TestAnalysis, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    borders = [analysis.release_s, analysis.half_cycles[1].start_s]
    if math.isfinite(analysis.rest_s):
        borders.append(max(analysis.rest_s, borders[-1]))
    return np.searchsorted(np.array(borders), time_s, side="right").astype(np.float64)

"""What an irregular vibration of the floor does to the motion: a random effect whose size is measured."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.oscillations.vibration import FloorSpectrum
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.prediction.model import RockingModel, swing_features
from daq_app.gap.rocking_model.run_cache import RunCache

_LINES = 2
"""Sinusoids in each band of half a hertz: they come back together after 4 s, where what the floor did to the
wall is long lost."""
_QUIETEST = 0.05
"""Rms of a band over that of the loudest below which it is left out."""


def on_its_floor(run: RockingRun) -> RockingRun:
    """The run with what its floor does to the motion in the errors of its features."""
    return run if run.floor is None else run.with_loadings(floor_loadings(run, run.floor))


def floor_loadings(run: RockingRun, floor: FloorSpectrum) -> FloatArray:
    """What the floor moves the features of a run by, (n, k) for draws of unit variance.

    A stationary floor is a sum of sinusoids with independent normal sines and cosines (Rice 1944). The wall
    of the survey answers each as a rocking block with base excitation does (Housner 1963), to first order.
    """
    still = replace(run, vibration=None, cache=RunCache())
    model = RockingModel(run.survey)
    values = {p.name: p.value(0.0) for p in (*model.nuisance, *model.local_nuisance(still))}
    quiet = np.concatenate(swing_features(still, values))
    columns = []
    for frequency_hz, rms_m_s2 in _sinusoids(floor):
        for phase in (0.0, 0.5 * math.pi):
            wave = {"ambient.amplitude": rms_m_s2, "ambient.frequency": frequency_hz, "ambient.phase": phase}
            column = np.zeros(len(run.features))
            column[: quiet.size] = np.concatenate(swing_features(still, {**values, **wave})) - quiet
            columns.append(column)
    return np.column_stack(columns)


def _sinusoids(floor: FloorSpectrum) -> Iterator[tuple[float, float]]:
    """(frequency, rms of its sine and of its cosine)."""
    width_hz = float(floor.frequency_hz[1] - floor.frequency_hz[0])
    for middle_hz, rms_m_s2 in zip(floor.frequency_hz, floor.rms_m_s2, strict=True):
        if rms_m_s2 < _QUIETEST * float(floor.rms_m_s2.max()):
            continue
        for line in range(_LINES):
            off = (line + 0.5) / _LINES - 0.5
            yield float(middle_hz + off * width_hz), float(rms_m_s2 / math.sqrt(_LINES))

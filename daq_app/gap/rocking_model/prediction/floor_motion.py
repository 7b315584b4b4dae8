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

_QUIETEST = 0.05
"""Rms of a band over that of the loudest below which it is left out."""
_FAINTEST = 1e-3
"""Size of a pattern in the features over that of the largest below which it is left out."""


def on_its_floor(run: RockingRun) -> RockingRun:
    """The run with what its floor does to the motion in the errors of its features."""
    if run.floor is None:
        return run
    return replace(run, floor_loadings=floor_loadings(run, run.floor), cache=RunCache())


def floor_loadings(run: RockingRun, floor: FloorSpectrum) -> FloatArray:
    """What the floor moves the times and peaks of a run by, (T + P, k) for draws of unit variance.

    A stationary floor is a sum of sinusoids with independent normal sines and cosines (Rice 1944). The wall
    of the survey answers each as a rocking block with base excitation does (Housner 1963), to first order.
    """
    still = replace(run, vibration=None, cache=RunCache())
    model = RockingModel(run.survey)
    values = {p.name: p.value(0.0) for p in (*model.nuisance, *model.local_nuisance(still))}
    quiet = np.concatenate(swing_features(still, values))
    columns = []
    for frequency_hz, rms_m_s2 in _sinusoids(floor, run.swings.rest_s - run.swings.release_s):
        for phase in (0.0, 0.5 * math.pi):
            wave = {"ambient.amplitude": rms_m_s2, "ambient.frequency": frequency_hz, "ambient.phase": phase}
            columns.append(np.concatenate(swing_features(still, {**values, **wave})) - quiet)
    patterns, sizes, _ = np.linalg.svd(np.column_stack(columns), full_matrices=False)
    kept = sizes > _FAINTEST * sizes[0]
    return np.asarray(patterns[:, kept] * sizes[kept])


def _sinusoids(floor: FloorSpectrum, motion_s: float) -> Iterator[tuple[float, float]]:
    """(frequency, rms of its sine and of its cosine).

    The frequencies are so near to each other that the sinusoids do not come back together within the motion:
    half-cycles that have nothing to do with each other would be taken for moved alike.
    """
    width_hz = float(floor.frequency_hz[1] - floor.frequency_hz[0])
    lines = math.ceil(width_hz * motion_s) + 1
    for middle_hz, rms_m_s2 in zip(floor.frequency_hz, floor.rms_m_s2, strict=True):
        if rms_m_s2 < _QUIETEST * float(floor.rms_m_s2.max()):
            continue
        for line in range(lines):
            off = (line + 0.5) / lines - 0.5
            yield float(middle_hz + off * width_hz), float(rms_m_s2 / math.sqrt(lines))

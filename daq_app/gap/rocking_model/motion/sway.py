"""Sway of a wall that is held or rests: a rotation slow enough to be told from noise twice differentiated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ

SWAY_HZ = 8.0
"""Low-pass limit for the sway of a wall, Hz (assumed); raising it adds noise to its acceleration."""


def sway(rotation: FloatArray, part: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
    """(θ about its mean, rad, and θ̈, rad/s²), (k,), of a rotation, (m,), at the k samples of one part."""
    low_pass = butter(3, SWAY_HZ, fs=GRID_HZ, output="sos")
    theta = sosfiltfilt(low_pass, rotation[part] - rotation[part].mean())
    return theta, np.gradient(np.gradient(theta, 1 / GRID_HZ), 1 / GRID_HZ)

"""What worker processes are forked from: the model imported, and its compiled kernel loaded once for all."""

from __future__ import annotations

import numpy as np

import daq_app.gap.rocking_model.prediction.model  # noqa: F401
from sim_hardware.dynamics import parameters, shooting

_none = np.zeros(0)
shooting.half_cycles(
    np.zeros(parameters.N_PARAMETERS), _none, _none, np.zeros((0, 1)), 1.0, True, np.zeros((0, 7))
)

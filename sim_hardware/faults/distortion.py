"""What a broken sensor line does to the volts at a terminal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim_hardware.faults.model import Fault

Volts = NDArray[np.float64]
_BEYOND_ANY_RAIL_V = 1e3
_MAINS_HZ = 50.0


def distort(fault: Fault, start_s: float, held_v: float, times_s: Volts, volts: Volts) -> Volts:
    """Volts under the fault, which began at `start_s` when the line stood at `held_v`."""
    since = times_s - start_s
    if fault.kind == "channel_stuck":
        value = fault.number("value_v")
        return np.full_like(volts, held_v if np.isnan(value) else value)
    if fault.kind == "channel_saturated":
        sign = 1.0 if fault.text("side") == "high" else -1.0
        return np.full_like(volts, sign * _BEYOND_ANY_RAIL_V)
    if fault.kind == "channel_open":
        # The input's bias current charges the open line; nothing but stray coupling drives it.
        drift = -np.expm1(-np.maximum(since, 0.0) / max(fault.number("drift_s"), 1e-6))
        pickup = fault.number("hum_v") * np.sin(2 * np.pi * _MAINS_HZ * since)
        return held_v + (_OPEN_LINE_V - held_v) * drift + pickup
    if fault.kind == "channel_hum":
        return volts + fault.number("amplitude_v") * np.sin(2 * np.pi * fault.number("frequency_hz") * since)
    return -volts


_OPEN_LINE_V = 12.0

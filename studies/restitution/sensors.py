"""Effects of the simulator on sensors that `faults` does not put in itself, in two sizes each."""

from __future__ import annotations

from typing import Final

from studies.restitution.walls import SimulatedEffect


def _of(effect: str, targets: tuple[str, ...], parameter: str, *sizes: float) -> list[SimulatedEffect]:
    return [SimulatedEffect(f"{effect}@{target}", {parameter: size}) for target in targets for size in sizes]


_WIRES: Final = ("wire", "WP-3")
_LVDTS: Final = ("lvdt", "LV-A03")
_BOTH: Final = (*_WIRES, *_LVDTS)
_OTHERS: Final = ("accelerometer", "tiltmeter")

SENSORS: Final = (
    *_of("filter_delay", _BOTH, "tau", 0.005, 0.02),
    *_of("wire_cosine", _WIRES, "kappa", 0.2, 1.0),
    *_of("wire_anchor", _WIRES, "height", 0.05, 0.3),
    *_of("wire_sag", _WIRES, "kappa", 1e-3, 1e-2),
    *_of("wire_inertia", _WIRES, "frequency", 10.0, 25.0),
    *_of("saturation", _WIRES, "limit", 0.02, 0.08),
    *_of("saturation", _LVDTS, "limit", 0.005, 0.02),
    *_of("dropout", (*_BOTH, *_OTHERS), "share", 0.01, 0.1),
    *_of("stuck", (*_BOTH, *_OTHERS), "after", 5.0, 9.0),
    *_of("quantisation", _BOTH, "step", 1e-4, 1e-3),
    *_of("noise", (*_BOTH, *_OTHERS), "factor", 5.0, 20.0),
    *_of("gain", ("LV-A03",), "error", 0.03, 0.1),
    *_of("drift", ("tiltmeter",), "rate", 1e-5, 1e-4),
    *_of("drift", ("LV-A03",), "rate", 1e-4, 1e-3),
    *_of("calibration", ("wire", "lvdt"), "tolerance", 0.003, 0.01),
    *_of("swap", ("wire", "lvdt", *_OTHERS), "places", 1.0, 2.0),
    *_of("polarity", ("WP-3", "LV-A03"), "on", 1.0),
    SimulatedEffect("clock", {"error": 0.02}),
    SimulatedEffect("clock", {"error": -0.0625}),
)
"""Times of `stuck` are those since power-on, 1 to 2 s before the wall is pulled and held for 4 to 6 s."""

"""How well the coefficients of a sensor family repeat, and how far a sound sensor may be off in all runs.

Two sizes for each coefficient. The *scatter* is what differs from run to run; the model's scatter of
sensors multiplies it. The *bias* is what a calibration certificate lets pass and a regression cannot
avoid: the same in all runs, Gaussian about zero, refitted under every hypothesis. An effect on a sensor
thus counts only as far as it exceeds what sound sensors do.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from daq_app.gap.core import Parameter
from daq_app.gap.rocking_model.features.sensor_blocks import Block


@dataclass(frozen=True, slots=True)
class Size:
    """Of one coefficient, in its own unit."""

    scatter: float
    bias: float = 0.0
    """Standard deviation; 0 where a calibration among the model's parameters says it already."""
    unit: str = ""


SIZES: dict[tuple[str, str], Size] = {
    ("wire", "gain"): Size(1e-4),
    ("wire", "lag"): Size(2e-5, 1e-4, "s"),
    ("wire", "even harmonic"): Size(3e-3),
    ("wire", "step with moment"): Size(3e-6, 4e-6, "rad"),
    ("wire", "drift"): Size(2e-6, 5e-6, "rad/s"),
    ("tiltmeter", "gain"): Size(3e-4),
    ("tiltmeter", "lag"): Size(1e-4, 3e-4, "s"),
    ("tiltmeter", "drift"): Size(2e-6, 6e-6, "rad/s"),
    ("accelerometer", "gain of gravity"): Size(1e-2),
    ("accelerometer", "gain of inertia"): Size(1e-3, 1e-3, "1"),
    ("impact timing", "delay"): Size(1e-4),
    ("swing timing", "delay"): Size(1e-4, 2e-4, "s"),
    ("base", "slip per speed"): Size(5e-5, 1e-4, "m s/rad"),
    ("base", "follows rotation"): Size(3e-4),
    ("joint", "pivot"): Size(3e-4),
    ("joint", "pivot left against right"): Size(5e-5, 1e-4, "m"),
    ("joint", "pivot with rotation"): Size(5e-3),
    ("joint", "contact length"): Size(5e-5, 3e-5, "m"),
    ("joint", "drift"): Size(1e-6, 2e-6, "m/s"),
    ("twist", "follows rotation"): Size(1.5e-4),
}
"""By (family, coefficient)."""
_NONE = Size(0.0)


def repeatability(block: Block, i: int) -> float:
    """Unit in which a coefficient scatters from run to run; 0 for what does not."""
    match block.rule:
        case "floor" | "bending" | "turning" | "release":
            return 0.0
        case "channel":
            return 0.1 * float(np.sqrt(block.covariance[i, i])) if i == len(block.names) - 1 else 0.0
    return SIZES[(block.family, block.names[i])].scatter


BIAS = "bias_"


@cache
def bias_names(family: str, coefficients: tuple[str, ...]) -> tuple[tuple[int, str], ...]:
    """(place, name of the parameter) of those coefficients of a block that have a bias."""
    return tuple(
        (i, _name(family, coefficient))
        for i, coefficient in enumerate(coefficients)
        if SIZES.get((family, coefficient), _NONE).bias > 0.0
    )


def _name(family: str, coefficient: str) -> str:
    return f"{BIAS}{family}_{coefficient}".replace(" ", "_")


def biases() -> tuple[Parameter, ...]:
    """The biases as parameters of the model."""
    return tuple(
        Parameter(
            _name(family, coefficient),
            0.0,
            size.bias,
            size.unit,
            meaning=f"what sound sensors may be off by: {coefficient} of {family}",
            linear=True,
        )
        for (family, coefficient), size in SIZES.items()
        if size.bias > 0.0
    ) + tuple(
        Parameter(
            unequal_name(family), 0.0, 1.0, "1", meaning=f"{family} from unequal accelerometers", linear=True
        )
        for family in ("bending", "turning")
    )


def unequal_name(family: str) -> str:
    """The parameter that says what unequal calibrations feign of a ring-down, in sd."""
    return f"{BIAS}{family}_unequal"

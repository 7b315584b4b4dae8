"""Responses of sensors on the grid: slow, filtered, resonant or delayed ones."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache, lru_cache

import numpy as np
from scipy.signal import cont2discrete, lfilter

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ


def first_order(values: FloatArray, time_constant_s: float, rate_hz: float = GRID_HZ) -> FloatArray:
    """Response, (n,), of a first-order sensor that starts in balance: τ ẏ + y = x."""
    if time_constant_s <= 0:
        return values
    a = np.exp(-1.0 / (time_constant_s * rate_hz))
    # The input is linear between samples: exact discretisation of the ramp response.
    b0 = 1.0 - (1.0 - a) * time_constant_s * rate_hz
    b1 = (1.0 - a) * time_constant_s * rate_hz - a
    state = np.array([values[0] - b0 * values[0]])
    return np.asarray(lfilter([b0, b1], [1.0, -a], values, zi=state)[0])


def slow_response(values: FloatArray, time_constants_s: FloatArray) -> FloatArray:
    """Mean response, (m,), of slow sensors with these time constants, (k,), s; `values` for none."""
    if time_constants_s.size == 0:
        return values
    return np.asarray(np.mean([first_order(values, float(slow)) for slow in time_constants_s], axis=0))


def bessel(values: FloatArray, delay_s: float, rate_hz: float = GRID_HZ) -> FloatArray:
    """Second-order Bessel low-pass, (n,), of group delay `delay_s`."""
    if delay_s <= 1e-5:
        # As good as a delay, and not nothing: a fit that starts from none has to see where it leads.
        return values - delay_s * rate_hz * np.gradient(values)
    return resonator(values, np.sqrt(3.0) / delay_s, np.sqrt(3.0) / 2.0, rate_hz)


def resonator(values: FloatArray, natural: float, zeta: float, rate_hz: float = GRID_HZ) -> FloatArray:
    """ÿ/ω² + 2ζẏ/ω + y = x for an x, (n,), that is straight between samples; it starts settled.

    `natural`: ω, rad/s.
    A bilinear transform would be off in delay by a fifth where the response is as quick as the grid.
    """
    numerator, denominator = _discrete(float(natural), float(zeta), rate_hz)
    return np.asarray(lfilter(numerator, denominator, values - values[0]) + values[0])


@lru_cache(maxsize=64)
def _discrete(natural: float, zeta: float, rate_hz: float) -> tuple[FloatArray, FloatArray]:
    """Filter of the resonator; all runs and blocks of one prediction ask for the same one."""
    numerator, denominator, _ = cont2discrete(
        ([natural**2], [1.0, 2.0 * zeta * natural, natural**2]), 1.0 / rate_hz, method="foh"
    )
    return numerator[0], denominator


EFFECTS = {
    "gain": "error",
    "lag": "tau",
    "slow_response": "tau",
    "filter_delay": "tau",
    "drift": "rate",
    "wire_cosine": "kappa",
    "wire_anchor": "height",
    "wire_inertia": "frequency",
}
"""Effects on a sensor family or on one channel, and the parameter that says that they are there."""


def effects_on(target: str, values: Mapping[str, float]) -> dict[str, float]:
    """Effects that there are on a family or a channel, each with its parameter of `EFFECTS`."""
    return {effect: value for effect, key in _keys(target) if (value := values.get(key)) is not None}


@cache
def _keys(target: str) -> tuple[tuple[str, str], ...]:
    return tuple((effect, f"{effect}@{target}.{parameter}") for effect, parameter in EFFECTS.items())


def responded(
    signal: FloatArray,
    effect: str,
    value: float,
    target: str,
    values: Mapping[str, float],
    rate_hz: float = GRID_HZ,
) -> FloatArray:
    """A signal, (m,), as sensors with an effect on `target` show it; `value` as in `EFFECTS`."""
    match effect:
        case "gain":
            return signal * (1.0 + value)
        case "lag":
            k = np.arange(signal.size, dtype=float)
            return np.asarray(np.interp(k - value * rate_hz, k, signal))
        case "slow_response":
            return first_order(signal, value, rate_hz)
        case "filter_delay":
            return bessel(signal, value, rate_hz)
        case "wire_inertia":
            return resonator(
                signal, 2.0 * np.pi * value, values.get(f"wire_inertia@{target}.zeta", 0.2), rate_hz
            )
        case "wire_cosine":
            return signal + value * signal**2
        case "drift":
            return signal + value * np.arange(signal.size) / rate_hz
    raise KeyError(effect)


def transfer(rate: complex, family: str, values: Mapping[str, float]) -> complex:
    """What a family's sensors make of exp(rate · t): the Laplace transform of their response."""
    factor = 1.0 + 0.0j
    if tau := values.get(f"lag@{family}.tau", 0.0):
        factor *= np.exp(-rate * tau)
    if tau := values.get(f"slow_response@{family}.tau", 0.0):
        factor /= 1.0 + rate * tau
    if tau := values.get(f"filter_delay@{family}.tau", 0.0):
        factor *= 3.0 / ((rate * tau) ** 2 + 3.0 * rate * tau + 3.0)
    if frequency := values.get(f"wire_inertia@{family}.frequency", 0.0):
        natural, zeta = 2.0 * np.pi * frequency, values.get(f"wire_inertia@{family}.zeta", 0.2)
        factor *= natural**2 / (rate**2 + 2.0 * zeta * natural * rate + natural**2)
    return complex(factor)


def electronics(family: str) -> str:
    """Parameter by which the electronics of a sound family are later than those of the LVDTs, s."""
    return f"late_{family}"


def later(first: str, second: str, values: Mapping[str, float]) -> float:
    """By how much the sensors of one family are later than those of another, s, electronics and all."""
    sound = [values.get(electronics(family), 0.0) for family in (first, second)]
    return sound[0] - sound[1] + delay(first, values) - delay(second, values)


def delay(family: str, values: Mapping[str, float]) -> float:
    """By how much effects make a family's sensors late, s."""
    late = sum(
        values.get(f"{effect}@{family}.tau", 0.0) for effect in ("lag", "slow_response", "filter_delay")
    )
    if frequency := values.get(f"wire_inertia@{family}.frequency", 0.0):
        late += values.get(f"wire_inertia@{family}.zeta", 0.2) / (np.pi * frequency)
    return late

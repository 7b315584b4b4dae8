"""The library of effects on the sensors: declarative, one entry each.

Each acts on the sensors named after ``@``: a channel id, a family, a module (``cDAQ1Mod3``) or a
terminal; all sensors where nothing is named.  Parameters are in SI, lengths and angles in the unit
of the sensor's quantity.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Channel
from sim_hardware.dynamics.spec import EffectSpec, Parameter, find_effect, split_target
from sim_hardware.sensors import layout as la
from sim_hardware.sensors.noise import generator

_FAMILY: Final = "sensor"

SENSOR_EFFECTS: Final[tuple[EffectSpec, ...]] = (
    EffectSpec(
        "gain",
        _FAMILY,
        "the sensitivity is not the certificate's",
        "q' = (1 + e) q",
        "calibration error",
        (Parameter("error", "1", -0.1, 0.1, "relative error", index=la.RW_GAIN),),
        ("pivot_shift", "alpha_asymmetry"),
        "families that measure the same rotation",
    ),
    EffectSpec(
        "calibration",
        _FAMILY,
        "every sensor has its own small error of sensitivity",
        "q' = (1 + e_i) q, e_i normal",
        "tolerance of calibration",
        (Parameter("tolerance", "1", 0.001, 0.01, "standard deviation over sensors", None, la.RW_GAIN, 0.0),),
    ),
    EffectSpec(
        "drift",
        _FAMILY,
        "the zero wanders",
        "q' = q + d t",
        "thermal drift",
        (Parameter("rate", "SI/s", -1e-3, 1e-3, "rad/s, m/s or m/s³", index=la.RW_DRIFT),),
        ("alpha_asymmetry", "sliding"),
        "record before release and after rest",
    ),
    EffectSpec(
        "lag",
        _FAMILY,
        "the signal comes late",
        "q'(t) = q(t − τ)",
        "transport delay",
        (Parameter("tau", "s", 0.001, 0.05, "delay", index=la.RW_DELAY),),
        ("winkler", "bounce", "slow_response"),
        "accelerometers and other families",
    ),
    EffectSpec(
        "slow_response",
        _FAMILY,
        "the sensor follows slowly",
        "τ q̇' = q − q'",
        "first-order response",
        (Parameter("tau", "s", 0.001, 0.05, "time constant", None, la.RW_FILTER_A, 0.0),),
        ("lag", "filter_delay"),
        "rounded zero crossings",
    ),
    EffectSpec(
        "filter_delay",
        _FAMILY,
        "a low-pass filter is in the way",
        "second-order Bessel filter of group delay τ",
        "anti-alias or converter filter",
        (Parameter("tau", "s", 0.001, 0.02, "group delay at low frequency", None, la.RW_FILTER_A, 0.0),),
        ("lag", "slow_response"),
        "high frequencies of the ringing are missing",
    ),
    EffectSpec(
        "saturation",
        _FAMILY,
        "the sensor clips early",
        "|q'| ≤ limit",
        "end of range",
        (Parameter("limit", "SI", 0.005, 0.2, "largest magnitude", None, la.RW_HIGH, 0.0),),
        ("residual_cable",),
        "flat tops",
    ),
    EffectSpec(
        "dropout",
        _FAMILY,
        "the value freezes for moments",
        "held for `duration` in a share of such intervals",
        "loose contact, missed conversions",
        (
            Parameter("share", "1", 0.001, 0.1, "share of intervals held", None, la.RW_DROP_SHARE, 0.0, 1.0),
            Parameter("duration", "s", 0.001, 0.1, "of an interval", 0.02, la.RW_DROP_S, 1e-4),
        ),
        (),
        "plateaus",
    ),
    EffectSpec(
        "stuck",
        _FAMILY,
        "the value freezes for good",
        "q'(t) = q(t₁) for t > t₁",
        "broken sensor",
        (Parameter("after", "s", 1.0, 60.0, "time since power-on", None, la.RW_STUCK, 0.0),),
    ),
    EffectSpec(
        "quantisation",
        _FAMILY,
        "the sensor itself has coarse steps",
        "q' = Δ round(q/Δ)",
        "digital sensor, wire-wound potentiometer",
        (Parameter("step", "SI", 1e-5, 1e-3, "step", None, la.RW_QUANTUM, 0.0),),
        (),
        "reading steps",
    ),
    EffectSpec(
        "noise",
        _FAMILY,
        "more noise than the certificate's",
        "σ' = k σ",
        "noise",
        (Parameter("factor", "1", 2.0, 20.0, "factor on the rms", None, la.RW_NOISE, 0.0),),
    ),
    EffectSpec(
        "wire_cosine",
        _FAMILY,
        "a wire is out of line: an even harmonic",
        "q' = q + κ q²",
        "misaligned wire",
        (Parameter("kappa", "1/m", -1.0, 1.0, "quadratic error", index=la.RW_QUADRATIC),),
        ("alpha_asymmetry",),
        "wires at several heights",
    ),
    EffectSpec(
        "wire_anchor",
        _FAMILY,
        "an anchor is not as high as the rig file says: the wire slopes, and sees the wall lift on one side",
        "A_z' = A_z + h",
        "geometry of the wire",
        (Parameter("height", "m", -0.5, 0.5, "how much higher the anchor is", index=la.RW_ANCHOR + 2),),
        ("wire_cosine",),
        "height of the anchor by spirit level",
    ),
    EffectSpec(
        "wire_sag",
        _FAMILY,
        "a wire hangs through",
        "length d + κ d³, κ = (w/T)²/24",
        "parabola of a taut wire",
        (Parameter("kappa", "1/m²", 1e-5, 1e-2, "sag", None, la.RW_SAG, 0.0),),
        ("gain",),
        "wires of several lengths",
    ),
    EffectSpec(
        "wire_inertia",
        _FAMILY,
        "drum and spring of a wire potentiometer resonate",
        "q̈'/ω² + 2ζ q̇'/ω + q' = q",
        "second-order response",
        (
            Parameter("frequency", "Hz", 8.0, 60.0, "of the resonance", None, la.RW_FILTER_A, 0.1, 1500.0),
            Parameter("zeta", "1", 0.05, 0.7, "damping ratio", 0.2, la.RW_FILTER_B, 0.0, 0.99),
        ),
        ("flexible_wall",),
        "accelerometers do not show it",
    ),
    EffectSpec(
        "hum",
        _FAMILY,
        "mains frequency on the signal",
        "q' = q + A sin(2πf t + φ_i)",
        "mains pick-up",
        (
            Parameter("amplitude", "SI", 1e-5, 1e-2, "amplitude", index=la.RW_HUM),
            Parameter("frequency", "Hz", 49.8, 50.2, "of the mains", 50.0, la.RW_HUM_W),
        ),
        ("flexible_wall",),
        "present before release",
    ),
    EffectSpec(
        "clock",
        _FAMILY,
        "the sample clock does not run at its rate",
        "t' = (1 + ε) t",
        "coerced rate taken for the requested one; oscillator",
        (
            Parameter(
                "error", "1", -0.07, 0.07, "ε: 4266.67 Hz taken for 4000 Hz is −0.0625", index=la.RW_CLOCK
            ),
        ),
        ("p",),
        "accelerometers against rotation, frequency of the hum",
    ),
    EffectSpec(
        "polarity",
        _FAMILY,
        "wired the wrong way round",
        "q' = −q where on = 1",
        "swapped leads",
        (Parameter("on", "1", 1.0, 1.0, "1 to swap", 1.0, la.RW_SLOPE, 0.0, 1.0),),
        (),
        "correlation matrix",
    ),
    EffectSpec(
        "swap",
        _FAMILY,
        "the sensors of the target are on each other's terminals",
        "rotated by `places` among the target's terminals, in the order of the rig file",
        "wiring error",
        (Parameter("places", "1", 1.0, 3.0, "whole number", 1.0, la.RW_FAMILY, 0.0),),
        (),
        "correlation matrix",
    ),
)
"""Every effect on the sensors."""


@dataclass(slots=True)
class Wiring:
    """Rows of all sensors, and which of them each terminal is wired to."""

    rows: NDArray[np.float64]
    """(n, N_ROW) in the order of the rig file."""
    sensor_at: NDArray[np.int64]
    """(n,) terminal of channel i is wired to sensor ``sensor_at[i]``."""


def targets(key: str, channels: Sequence[Channel]) -> NDArray[np.int64]:
    """Indices of the channels that an effect's key means; `ValueError` in words if there are none.

    ``swap@WP-2+WP-5`` means both, in the order of the rig file.
    """
    _, target = split_target(key)
    chosen = {i for part in target.split("+") for i in _meant(key, part, channels)}
    return np.array(sorted(chosen), dtype=np.int64)


def _meant(key: str, target: str, channels: Sequence[Channel]) -> list[int]:
    chosen = [
        i
        for i, channel in enumerate(channels)
        if not target
        or target in (channel.id, channel.family, channel.physical_channel)
        or channel.physical_channel.startswith(f"{target}/")
    ]
    if not chosen:
        raise ValueError(
            f"effect {key!r}: no channel, family, module or terminal of the rig is called {target!r}; "
            f"families are {', '.join(la.FAMILY_CODE)}, channels {channels[0].id} … {channels[-1].id}"
        )
    return chosen


def apply_sensor_effects(
    wiring: Wiring, channels: Sequence[Channel], effects: Mapping[str, Mapping[str, float]], seed: int
) -> None:
    """Change `wiring` by `effects` (``name@target`` → parameters); `ValueError` in words."""
    for key, given in effects.items():
        spec = find_effect(key, SENSOR_EFFECTS)
        values = spec.complete(given)
        chosen = targets(key, channels)
        if spec.name == "swap":
            wiring.sensor_at[chosen] = np.roll(wiring.sensor_at[chosen], int(values["places"]))
        else:
            for i in chosen:
                _change(wiring.rows[i], spec, values, channels[i].id, seed)


def _change(
    row: NDArray[np.float64], spec: EffectSpec, values: Mapping[str, float], name: str, seed: int
) -> None:
    strength = values[spec.strength.name]
    match spec.name:
        case "gain":
            row[la.RW_GAIN] *= 1.0 + strength
        case "calibration":
            row[la.RW_GAIN] *= 1.0 + strength * generator(seed, name, "calibration").standard_normal()
        case "wire_anchor":
            row[la.RW_ANCHOR + 2] += strength
        case "clock":
            row[la.RW_CLOCK] = 1.0 + strength
        case "noise":
            row[la.RW_NOISE] *= strength
        case "polarity":
            row[la.RW_SLOPE] *= 1.0 - 2.0 * round(strength)
        case "saturation":
            row[la.RW_LOW], row[la.RW_HIGH] = max(row[la.RW_LOW], -strength), min(row[la.RW_HIGH], strength)
        case "hum":
            row[la.RW_HUM], row[la.RW_HUM_W] = strength, 2.0 * math.pi * values["frequency"]
            row[la.RW_HUM_PHASE] = generator(seed, name, "hum").uniform(-math.pi, math.pi)
        case "slow_response" | "filter_delay" | "wire_inertia":
            _change_response(row, spec.name, strength, values, name)
        case _:
            for parameter in spec.parameters:
                row[parameter.index] = values[parameter.name]


def _change_response(
    row: NDArray[np.float64], effect: str, strength: float, values: Mapping[str, float], name: str
) -> None:
    """Effects that make a sensor follow its measurand late; a time of 0 s is none."""
    match effect:
        case "wire_inertia":
            _respond(row, effect, name, la.RESONANCE, 2.0 * math.pi * strength, values["zeta"])
        case "slow_response" if strength > 0.0:
            _respond(row, effect, name, la.LOW_PASS, row[la.RW_FILTER_A] + strength, 0.0)
        case "filter_delay" if strength > 0.0:
            zeta = math.sqrt(3.0) / 2.0  # of the second-order Bessel filter; group delay 2ζ/ω
            _respond(row, effect, name, la.RESONANCE, 2.0 * zeta / strength, zeta)


def _respond(row: NDArray[np.float64], effect: str, name: str, kind: int, a: float, b: float) -> None:
    """Give a sensor a dynamic response; one that has another already cannot take it."""
    has = int(row[la.RW_FILTER])
    if has != la.NO_FILTER and not (kind == la.LOW_PASS and has == la.LOW_PASS):
        raise ValueError(
            f"effect {effect!r} cannot act on {name}: this sensor already has a dynamic response; "
            "name other sensors after '@', for instance @wire"
        )
    row[la.RW_FILTER], row[la.RW_FILTER_A], row[la.RW_FILTER_B] = kind, a, b

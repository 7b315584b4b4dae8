"""The effects that the diagnosis knows, by the simulator's names, so that each can be switched on there."""

from __future__ import annotations

from collections.abc import Iterable

from daq_app.gap.core import Confusion, Effect, Library, Parameter
from daq_app.gap.core.parameters import between, positive, signed
from daq_app.gap.rocking_model.vector import PROBE_SPEEDS
from sim_hardware.dynamics.effects import MOTION_EFFECTS
from sim_hardware.dynamics.spec import EffectSpec
from sim_hardware.dynamics.spec import Parameter as SpecParameter
from sim_hardware.sensors.effects import SENSOR_EFFECTS

_MOTION = (
    "pivot_shift",
    "winkler",
    "rounded_edge",
    "crushing",
    "restitution_wear",
    "restitution_slope",
    "restitution_asymmetry",
    "viscous",
    "coulomb",
    "alpha_asymmetry",
    "base_tilt",
    "eccentric_mass",
    "dwell",
    "bounce",
    "sliding",
    "compliance",
    "residual_cable",
    "initial_velocity",
    "slow_release",
)
"""Effects on the motion that leave a mark on the features used here."""
_FREE = {"bounce": ("tau",), "residual_cable": ("k",), "restitution_slope": ("k",)}
"""Which parameters are fitted where not all are; the others keep the simulator's defaults."""
_LOGARITHMIC = {("winkler", "theta_c"), ("slow_release", "tau"), ("residual_cable", "slack")}
_PER_RUN = {("initial_velocity", "omega")}
_SENSORS = {
    "gain": ("lvdt", "wire", "tiltmeter", "accelerometer"),
    "lag": ("lvdt", "wire", "accelerometer"),
    "slow_response": ("lvdt", "wire"),
    "filter_delay": ("wire",),
    "drift": ("lvdt", "wire", "tiltmeter"),
    "wire_cosine": ("wire",),
}
_DRIFT_REACH = {"lvdt": 1e-3, "wire": 2e-3, "tiltmeter": 1e-3}


def _parameter(spec: EffectSpec, parameter: SpecParameter) -> Parameter:
    """The prior of one of the simulator's parameters: its range is about two prior sd."""
    if (spec.name, parameter.name) in _LOGARITHMIC:
        return between(
            parameter.name, max(parameter.low, 1e-6), parameter.high, parameter.unit, parameter.text
        )
    per_run = (spec.name, parameter.name) in _PER_RUN
    if parameter.low < 0:
        return signed(parameter.name, parameter.high, parameter.unit, parameter.text, per_run=per_run)
    return positive(parameter.name, parameter.high, parameter.unit, parameter.text, per_run=per_run)


def _motion_effect(spec: EffectSpec, known: set[str]) -> Effect:
    names = _FREE.get(spec.name, tuple(p.name for p in spec.parameters if p.name != "v_mean"))
    return Effect(
        spec.name,
        spec.family,
        tuple(_parameter(spec, p) for p in spec.parameters if p.name in names),
        spec.equation,
        spec.reference,
        spec.summary,
        tuple(Confusion(other, spec.separated_by) for other in spec.confusable if other in known),
    )


def _sensor_effects(known: set[str]) -> Iterable[Effect]:
    by_name = {spec.name: spec for spec in SENSOR_EFFECTS}
    for name, families in _SENSORS.items():
        spec = by_name[name]
        for family in families:
            parameter = _parameter(spec, spec.strength)
            if name == "drift":
                reach = _DRIFT_REACH[family]
                parameter = signed(
                    "rate", reach, "rad/s" if family == "tiltmeter" else "m/s", "drift of the zero"
                )
            yield Effect(
                f"{name}@{family}",
                "sensor",
                (parameter,),
                spec.equation,
                spec.reference,
                f"{spec.summary} ({family})",
                tuple(Confusion(other, spec.separated_by) for other in spec.confusable if other in known),
            )
    clock = by_name["clock"]
    yield Effect(
        "clock",
        "sensor",
        (signed("error", 0.07, "1", clock.strength.text),),
        clock.equation,
        clock.reference,
        clock.summary,
    )


def _probes() -> Iterable[Effect]:
    knots = tuple(signed(f"k{i}", 0.04, "1", f"change of r at {v} rad/s") for i, v in enumerate(PROBE_SPEEDS))
    more = (signed("side", 0.02, "1", "left against right"), signed("order", 0.02, "1", "per ten impacts"))
    yield Effect(
        "free_restitution",
        "restitution",
        knots + more,
        "r = r₀ + f(v) + s·side + c·n, f piecewise linear",
        "non-parametric",
        kind="probe",
    )
    places = [
        f"{part} at {size} α" for part in ("upper part", "lower part", "turning") for size in (0, 0.15, 0.4)
    ]
    yield Effect(
        "free_restoring",
        "interface",
        tuple(signed(f"t{i}", 0.01, "s", text, linear=True) for i, text in enumerate(places)),
        "half-cycle times + f(peak), the same up and down",
        "non-parametric",
        kind="probe",
    )
    yield Effect(
        "free_dissipation",
        "dissipation",
        tuple(signed(f"t{i}", 0.005, "s", text, linear=True) for i, text in enumerate(places[:6])),
        "times of the fall + f(peak), of the rise − f(peak)",
        "non-parametric",
        kind="probe",
    )
    for family, count in (("wire", 5), ("accelerometer", 2), ("joint", 5), ("base", 2), ("tiltmeter", 3)):
        kind = {"joint": "interface", "base": "contact"}.get(family, "sensor")
        yield Effect(
            f"free_{family}",
            kind,
            tuple(signed(f"c{i}", 40.0, "1", f"coefficient {i}", linear=True) for i in range(count)),
            f"every coefficient of the {family} family is free",
            "non-parametric",
            kind="probe",
        )


def rocking_library() -> Library:
    """All effects and probes."""
    specs = [spec for spec in MOTION_EFFECTS if spec.name in _MOTION]
    known = {spec.name for spec in specs}
    return Library([*(_motion_effect(spec, known) for spec in specs), *_sensor_effects(known), *_probes()])

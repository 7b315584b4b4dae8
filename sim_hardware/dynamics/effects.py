"""The library of effects on the motion: declarative, one entry each; the terms live in `terms`.

Ranges are judgement (the project's survey of the literature and of a prototype); names of the
parameters carry no unit, the entry says it.  θc, ζ … follow the symbols of docs/explanation/physics.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_hardware.dynamics import parameters as par
from sim_hardware.dynamics.spec import EffectSpec, Parameter, find_effect

_PLASTIC: Final = Parameter(
    "plastic",
    "1",
    0.0,
    1.0,
    "share λ of a plastic impact's difference of r between the sides",
    0.0,
    par.UNEVEN_IMPACT,
    0.0,
    1.0,
)
"""A wall loses another share of its speed than a plastic impact takes. How this differs by side is open."""


def _of_square(index: int) -> Parameter:
    """An impact throws the base aside, and friction stops it over a way that goes with its speed squared."""
    text = "share that goes with the square of the speed, told at 0.2 rad/s"
    return Parameter("square", "1", 0.0, 1.0, text, 0.0, index, 0.0, 1.0)


MOTION_EFFECTS: Final[tuple[EffectSpec, ...]] = (
    EffectSpec(
        "pivot_shift",
        "interface",
        "the wall turns about a point inside its edge",
        "u = b/2 − a; R' = √(h² + u²), α' = atan(u/h), p'² = W R'/(I_G + m R'²)",
        "Costa et al., Eqns 2.1 to 2.3",
        (Parameter("a", "m", 0.008, 0.05, "shift of the pivot inwards", index=par.PIVOT_SHIFT),),
        ("gain", "alpha_asymmetry"),
        "neutral axis of the LVDT profile",
    ),
    EffectSpec(
        "winkler",
        "interface",
        "compliant base joint without tension",
        "arm = (b/2)(1 − ⅔√(θc/θ)) for θ > θc, (b/2) θ/(3θc) below; θc = 2W/(k l b²)",
        "beam on a no-tension Winkler bed; Costa et al., section 2",
        (Parameter("theta_c", "rad", 1e-5, 9e-4, "first uplift", None, par.WINKLER, 0.0, 0.02),),
        ("lag", "pivot_shift"),
        "LVDT profile near upright, accelerometers",
    ),
    EffectSpec(
        "rounded_edge",
        "interface",
        "the base rolls on rounded edges",
        "I_C(θ) θ̈ = −m arm (g + ρ θ̇²), contact below the centre of a circle of radius ρ",
        "Lagrange's equation of a block rolling on an arc",
        (Parameter("rho", "m", 0.005, 0.1, "radius of the edges", index=par.EDGE_RADIUS, minimum=0.0),),
        ("pivot_shift",),
        "height of the LVDTs' points above the joint; with it, how the opening grows with θ²",
    ),
    EffectSpec(
        "crushing",
        "interface",
        "the edges wear from test to test",
        "α_N = α (1 − c N/100) after N impacts of the whole campaign",
        "progressive crushing of the base joint, Costa et al., section 5",
        (Parameter("loss", "1", 0.001, 0.03, "relative loss of α per 100 impacts", index=par.CRUSH_ALPHA),),
        ("pivot_shift",),
        "repetitions at the end of the campaign",
    ),
    EffectSpec(
        "restitution_wear",
        "interface",
        "r drifts from test to test",
        "r_N = r (1 − c N/100) after N impacts of the whole campaign",
        "progressive crushing of the base joint, Costa et al., section 5",
        (Parameter("loss", "1", 0.001, 0.03, "relative loss of r per 100 impacts", index=par.CRUSH_R),),
        ("crushing",),
        "half-cycle durations at equal peaks",
    ),
    EffectSpec(
        "restitution_slope",
        "restitution",
        "r depends on the approach speed",
        "r = r₀ + k (|θ̇⁻| − v̄)",
        "velocity-dependent restitution",
        (
            Parameter("k", "s/rad", -0.05, 0.05, "slope of r", index=par.R_SLOPE),
            Parameter("v_mean", "rad/s", 0.1, 0.4, "speed at which r is r₀", 0.2, par.R_SLOPE_SPEED),
        ),
        ("viscous",),
        "energy within a swing",
    ),
    EffectSpec(
        "restitution_asymmetry",
        "restitution",
        "impacts of the two edges lose different amounts",
        "r± = r ± d, + for impacts that end a swing to +x",
        "different state of the two edges",
        (Parameter("d", "1", -0.02, 0.02, "half the difference of r", index=par.R_ASYMMETRY),),
        ("alpha_asymmetry",),
        "durations alternate with α, losses with r",
    ),
    EffectSpec(
        "restitution_scatter",
        "restitution",
        "r varies from impact to impact",
        "r_n = r (1 + σ ε_n), ε_n standard normal",
        "lack of repeatability of impacts",
        (Parameter("sigma", "1", 0.001, 0.02, "relative standard deviation", None, par.SCATTER, 0.0),),
    ),
    EffectSpec(
        "viscous",
        "dissipation",
        "damping in proportion to the angular velocity",
        "θ̈ ∋ −2 ζ p θ̇",
        "linear viscous damping",
        (Parameter("zeta", "1", 0.001, 0.02, "damping ratio", index=par.ZETA),),
        ("coulomb", "restitution_slope"),
        "several levels: the loss between impacts",
    ),
    EffectSpec(
        "coulomb",
        "dissipation",
        "damping of constant moment",
        "θ̈ ∋ −μ p² α sgn θ̇",
        "dry friction",
        (Parameter("mu", "1", 0.001, 0.02, "moment relative to W R α", index=par.COULOMB, minimum=0.0),),
        ("viscous",),
        "several levels: the loss is independent of the amplitude",
    ),
    EffectSpec(
        "quadratic_drag",
        "dissipation",
        "damping in proportion to the square of the angular velocity",
        "θ̈ ∋ −c θ̇ |θ̇|",
        "air drag; c = ρ_air C_D l H⁴ / (8 I_O)",
        (Parameter("c", "1/rad", 0.001, 0.1, "coefficient", index=par.QUADRATIC),),
        ("viscous",),
        "several levels",
    ),
    EffectSpec(
        "alpha_asymmetry",
        "geometry",
        "the two edges have different α",
        "α± = α ± δ, + for swings to +x; r as with e = −δ h/cos²α (eccentric_mass)",
        "unequal edges; angular momentum about the edge that the wall comes down on",
        (
            Parameter("delta", "rad", -5e-3, 5e-3, "half the difference of α", index=par.ALPHA_ASYMMETRY),
            _PLASTIC,
        ),
        ("drift", "base_tilt", "eccentric_mass"),
        "static tilt",
    ),
    EffectSpec(
        "base_tilt",
        "geometry",
        "the base is not level",
        "θ̈ = −s p² sin(α − s(θ + β))",
        "tilted base",
        (Parameter("beta", "rad", -5e-3, 5e-3, "tilt of the base towards +x", index=par.BASE_TILT),),
        ("alpha_asymmetry", "eccentric_mass"),
        "static tilt",
    ),
    EffectSpec(
        "eccentric_mass",
        "geometry",
        "the centre of mass is off the middle of the base",
        "u± = b/2 ∓ e; r of impacts that end a swing to ±x is r (1 ∓ 2 λ e p² sin α / g)",
        "eccentric block; angular momentum about the edge that the wall comes down on",
        (
            Parameter("e", "m", -7e-3, 7e-3, "eccentricity towards +x", index=par.ECCENTRICITY),
            _PLASTIC,
        ),
        ("alpha_asymmetry", "base_tilt"),
        "static tilt",
    ),
    EffectSpec(
        "cubic",
        "geometry",
        "restoring moment with a cubic part",
        "θ̈ ∋ −κ p² α (θ/α)³",
        "a moment–rotation curve of another form",
        (Parameter("kappa", "1", -0.3, 0.3, "cubic part relative to W R α", index=par.CUBIC),),
        ("rounded_edge",),
        "several levels",
    ),
    EffectSpec(
        "dwell",
        "contact",
        "the wall stays on both edges for a moment",
        "θ = 0 for τ after each impact",
        "contact of finite duration",
        (Parameter("tau", "s", 5e-4, 0.01, "time of contact", index=par.DWELL, minimum=0.0, maximum=0.2),),
        ("lag", "bounce"),
        "LVDTs and accelerometers",
    ),
    EffectSpec(
        "bounce",
        "contact",
        "the wall hops: a second impact follows the first",
        "flight at constant θ̇ for τ |θ̇⁻|/0.2 rad/s; r is shared r^s, r^(1−s)",
        "bouncing block",
        (
            Parameter("tau", "s", 5e-4, 0.01, "flight at 0.2 rad/s", None, par.BOUNCE, 0.0, 0.1),
            Parameter("share", "1", 0.2, 0.8, "part of ln r in the first", 0.5, par.BOUNCE_SHARE, 0.0, 1.0),
        ),
        ("lag", "dwell"),
        "two marks per impact on the accelerometers",
    ),
    EffectSpec(
        "sliding",
        "contact",
        "the base slips to and fro at impacts",
        "Δx = c θ̇⁻ (1 − q + q |θ̇⁻|/0.2)",
        "sliding block",
        (
            Parameter("c", "m s/rad", 2e-4, 0.02, "slip per approach speed", index=par.SLIDE),
            _of_square(par.SLIDE_SQUARE),
        ),
        ("drift",),
        "wires step together, LVDTs do not",
    ),
    EffectSpec(
        "sliding_on",
        "contact",
        "the base slips to one side at impacts, on and on",
        "Δx = c |θ̇⁻| (1 − q + q |θ̇⁻|/0.2)",
        "sliding block on a floor that favours one way",
        (
            Parameter("c", "m s/rad", -0.02, 0.02, "slip towards +x per approach speed", index=par.SLIDE_ON),
            _of_square(par.SLIDE_ON_SQUARE),
        ),
        ("drift", "sliding"),
        "wires step together at impacts, LVDTs do not; before and after they are still",
    ),
    EffectSpec(
        "corner_twist",
        "contact",
        "the wall turns about a corner at each impact, and stays turned",
        "Δψ = c (cos φ + sin φ sgn θ̇⁻) |θ̇⁻|",
        "block on four corners with friction",
        (
            Parameter("c", "s", -6e-3, 6e-3, "turn per approach speed", index=par.TURN),
            Parameter(
                "alternation",
                "rad",
                -1.5708,
                1.5708,
                "0 turns on and on, ±π/2 back and forth",
                0.0,
                par.TURN_ALTERNATION,
            ),
        ),
        ("drift", "yaw"),
        "wires at the two ends step apart at impacts and stay there; LVDTs do not",
    ),
    EffectSpec(
        "flexible_wall",
        "structure",
        "the wall bends: a mode rings after each impact",
        "u(z) = q (z/H)²; q̈ + 2ζω q̇ + ω² q = 0, q̇ jumps by g_m Δθ̇ ω",
        "one cantilever mode of the wall",
        (
            Parameter("gain", "m s/rad", 5e-4, 0.01, "top displacement per jump of θ̇", index=par.MODE_GAIN),
            Parameter("frequency", "Hz", 9.0, 35.0, "of the mode", 18.0, par.MODE_HZ, 0.1),
            Parameter("zeta", "1", 0.01, 0.05, "damping ratio", 0.02, par.MODE_ZETA, 0.0, 0.99),
        ),
        ("hum", "wire_inertia"),
        "phase up the height",
    ),
    EffectSpec(
        "compliance",
        "structure",
        "the base under the wall gives way",
        "θ_measured = θ + φ₀ M/(W R sin α)",
        "elastic half-space or rig",
        (Parameter("phi", "rad", 1e-4, 3e-3, "rotation of the base under W R sin α", index=par.COMPLIANCE),),
        ("winkler", "gain"),
        "tiltmeter on the base, LVDTs against wires",
    ),
    EffectSpec(
        "twist",
        "structure",
        "the wall twists along its length",
        "θ(y) = θ + τ y; τ = f θ + oscillator kicked by k Δθ̇",
        "second degree of freedom",
        (
            Parameter("kick", "1/m", -0.05, 0.05, "twist rate per velocity jump", 0.0, par.TWIST_KICK),
            Parameter("follow", "1/m", -0.02, 0.02, "twist per rotation", 0.0, par.TWIST_FOLLOW),
            Parameter("frequency", "Hz", 2.0, 12.0, "of the oscillator", 5.0, par.TWIST_HZ, 0.1),
            Parameter("zeta", "1", 0.01, 0.1, "damping ratio", 0.04, par.TWIST_ZETA, 0.0, 0.99),
        ),
        ("gain",),
        "two wires at the top and the slope of the LVDTs along the length",
    ),
    EffectSpec(
        "yaw",
        "structure",
        "the wall turns about the vertical",
        "ψ: oscillator kicked by k Δθ̇",
        "second degree of freedom",
        (
            Parameter("kick", "1", -0.05, 0.05, "yaw rate per velocity jump", None, par.YAW_KICK),
            Parameter("frequency", "Hz", 2.0, 12.0, "of the oscillator", 5.0, par.TWIST_HZ, 0.1),
            Parameter("zeta", "1", 0.01, 0.1, "damping ratio", 0.04, par.TWIST_ZETA, 0.0, 0.99),
        ),
        ("twist",),
        "LVDTs show no slope along the length",
    ),
    EffectSpec(
        "residual_cable",
        "release",
        "the pulling cable still holds on",
        "θ̈ ∋ −k p² (θ − θs)₊ on the side of the release",
        "slack cable",
        (
            Parameter("k", "1", 0.005, 0.1, "stiffness relative to W R", index=par.CABLE, minimum=0.0),
            Parameter("slack", "rad", 0.0, 0.05, "rotation at which it grips", 0.02, par.CABLE_SLACK, 0.0),
        ),
        ("saturation",),
        "one side only, also where no sensor is near its range",
    ),
    EffectSpec(
        "taut_cable",
        "release",
        "a cable pulls to one side while the wall stands upright",
        "θ̈ ∋ k p² (θs − θ) while it is taut: below θs > 0, beyond θs < 0",
        "preloaded cable",
        (
            Parameter("k", "1", 0.005, 0.2, "stiffness relative to W R", index=par.STAY, minimum=0.0),
            Parameter("loose", "rad", -0.15, 0.15, "rotation at which it is slack", 0.05, par.STAY_LOOSE),
            Parameter(
                "release", "rad", -0.15, 0.15, "added to that on the release side", 0.0, par.STAY_RELEASE
            ),
        ),
        ("base_tilt", "eccentric_mass"),
        "the period at large rotations: a cable is a spring as well, and leans on one side alone",
    ),
    EffectSpec(
        "initial_velocity",
        "release",
        "the wall is moving when it is let go",
        "|θ|̇(0) = ω₀",
        "imperfect release",
        (Parameter("omega", "rad/s", -0.03, 0.03, "speed away from upright at release", index=par.OMEGA0),),
        ("slow_release",),
        "the first quarter-cycle",
    ),
    EffectSpec(
        "slow_release",
        "release",
        "the holding force dies away slowly",
        "θ̈ ∋ p² sin(α − θ₀) h(t) until it turns; h = (1 − e x)^(1/e), x = t/(τ (1 + e)); exp(−t/τ) at e = 0",
        "imperfect release",
        (
            Parameter("tau", "s", 0.005, 0.1, "mean time of the force", index=par.SLOW_RELEASE, minimum=0.0),
            Parameter("even", "1", 0.0, 1.0, "1: it falls evenly", 0.0, par.RELEASE_EVEN, 0.0, 1.0),
        ),
        ("initial_velocity", "lag"),
        "the first quarter-cycle",
    ),
    EffectSpec(
        "ambient",
        "ambient",
        "the floor vibrates",
        "ẍ_base = A sin(2πf t + φ); θ̈ ∋ −p² (ẍ_base/g) cos(α − |θ|)",
        "base excitation of the rocking block (Housner 1963)",
        (
            Parameter("amplitude", "m/s²", 0.01, 0.3, "of the base's acceleration", index=par.AMBIENT),
            Parameter("frequency", "Hz", 0.5, 4.0, "of the vibration", 2.0, par.AMBIENT_HZ, 0.0),
            Parameter("phase", "rad", -np.pi, np.pi, "at release", 0.0, par.AMBIENT_PHASE),
        ),
        ("flexible_wall",),
        "record before release",
    ),
)
"""Every effect on the motion."""


def apply_motion_effects(vector: NDArray[np.float64], effects: Mapping[str, Mapping[str, float]]) -> None:
    """Write the parameters of `effects` (name → parameters) into a kernel vector; `ValueError` in words."""
    for name, given in effects.items():
        spec = find_effect(name, MOTION_EFFECTS)
        for parameter, value in spec.complete(given).items():
            vector[spec.parameter(parameter).index] = value

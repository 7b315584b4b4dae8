"""Forms beyond the named ones: free forms of whole families, and first steps away from one effect."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from daq_app.gap.core import Confusion, Effect, Parameter
from daq_app.gap.core.parameters import signed
from daq_app.gap.rocking_model.prediction.vector import PROBE_SPEEDS

_LAWS = ("restitution_slope",)
_LOSSES = ("viscous", "coulomb")
_MORE_SPEEDS = "release from lower and from higher levels: how r goes with the speed shows there"
_MORE_ROTATIONS = "release from lower and from higher levels: how the loss grows with θ shows there"


def probes() -> Iterable[Effect]:
    """The free form of each family that has one."""
    knots = tuple(signed(f"k{i}", 0.04, "1", f"change of r at {v} rad/s") for i, v in enumerate(PROBE_SPEEDS))
    more = (signed("side", 0.02, "1", "left against right"), signed("order", 0.02, "1", "per ten impacts"))
    form = "r = r₀ + f(v) + s·side + c·n, f piecewise linear"
    yield _probe("free_restitution", "restitution", knots + more, form, _LAWS, _MORE_SPEEDS)
    places = [
        f"{part} at {size} α" for part in ("upper part", "lower part", "turning") for size in (0, 0.15, 0.4)
    ]
    up_and_down = tuple(signed(f"t{i}", 0.01, "s", text, linear=True) for i, text in enumerate(places))
    yield _probe(
        "free_restoring", "interface", up_and_down, "half-cycle times + f(peak), the same up and down"
    )
    yield _probe("free_geometry", "geometry", up_and_down, "half-cycle times ± f(peak) by side")
    lost = tuple(signed(f"t{i}", 0.005, "s", text, linear=True) for i, text in enumerate(places[:6]))
    form = "times of the fall + f(peak), of the rise − f(peak)"
    yield _probe("free_dissipation", "dissipation", lost, form, _LOSSES, _MORE_ROTATIONS)


def _probe(
    name: str,
    family: str,
    shape: tuple[Parameter, ...],
    form: str,
    laws: tuple[str, ...] = (),
    measure: str = "",
) -> Effect:
    confusions = tuple(Confusion(law, measure) for law in laws)
    return Effect(name, family, shape, form, "non-parametric", confusable_with=confusions, kind="probe")


def departures() -> Iterable[Effect]:
    """First steps away from the form of an effect, one coefficient each.

    A law with a power of the speed, v^n, differs from one that is linear in it by (n − 1) v ln v at first, a
    curved one by the square. A damping that is not one number is asked as decrements show it, by amplitude
    and by side; edges that are not alike by α of either side, which changes with the rotation. Priors are
    wide: on top of an effect only the direction counts.
    """
    power = signed("c", 0.6, "1")
    yield _departure("slope_power", "restitution", _LAWS, power, 2.4, "r = r₀ + k v + c v ln v")
    square = signed("c", 1.0, "s²/rad²")
    yield _departure("slope_square", "restitution", _LAWS, square, 6.0, "r = r₀ + k v + c (v − 0.2 rad/s)²")
    # Between viscous and Coulomb the library has the pair; a steeper law is neither with a positive share.
    steeper = replace(signed("mu", 0.02, "1"), high=0.0)
    words = "loss steeper than ω: viscous less a Coulomb part"
    yield _departure("loss_power", "dissipation", ("viscous",), steeper, 0.6, words)
    growth, side = signed("zeta", 0.02, "1"), signed("zeta", 0.02, "1")
    yield _departure("loss_growth", "dissipation", _LOSSES, growth, 0.6, "loss + damping that grows as ln φ")
    words = "loss + damping of either side's own, ± ζ"
    yield _departure("loss_side", "dissipation", _LOSSES, side, 1.2, words)
    # The round edge has the smaller α, by its radius over the height of the centroid, a metre and a half.
    radius = signed("rho", 0.05, "m")
    words = "edges round to different radii: α of either side changes with its rotation"
    uneven = _departure("uneven_edges", "geometry", ("alpha_asymmetry",), radius, -1.5, words)
    yield replace(uneven, directed=True)
    words = "loss of α with another power of the number of impacts: c N + c' N ln(N/100)"
    yield _departure("wear_power", "interface", ("crushing",), signed("loss", 0.03, "1"), 1.0, words)


def _departure(
    name: str, family: str, of: tuple[str, ...], one: Parameter, typical: float, equation: str
) -> Effect:
    shape = replace(one, starts=(0.0,))
    return Effect(name, family, (shape,), equation, "first order", kind="departure", of=of, typical=typical)

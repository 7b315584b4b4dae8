"""Effects switched on in the simulated hardware are named, with their strength inside the interval."""

from __future__ import annotations

import pytest

from daq_app.gap.core import fit
from daq_app.gap.rocking_model.library import rocking_library
from daq_app.gap.rocking_model.prediction.model import RockingModel
from daq_app.gap.rocking_model.study import diagnose_runs, prepare
from tests.support.simulated_wall import simulate

LEVELS = (0.15, -0.25, 0.35, -0.40)
LIBRARY = rocking_library()


def test_a_wall_without_effects_gives_back_its_own_parameters() -> None:
    runs, _ = prepare(simulate({}, LEVELS))
    found = fit(RockingModel(runs[0].survey), runs)
    for name, true in (("alpha", 0.215), ("r", 0.9)):
        value, low, high = found.values[name]
        assert low - 0.3 * (high - low) < true < high + 0.3 * (high - low), name
        assert value == pytest.approx(true, rel=4e-3)
    assert found.sigmas["scatter of r"] == pytest.approx(0.004, rel=0.35)
    assert found.sigmas["scatter of times"] < 2e-4


@pytest.mark.heavy
@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ("effect", "parameter", "strength", "rivals"),
    [
        ("viscous", "zeta", 0.006, ("coulomb", "restitution_slope", "lag@wire")),
        ("pivot_shift", "a", 0.02, ("gain@lvdt", "winkler", "alpha_asymmetry")),
        ("lag@lvdt", "tau", 0.006, ("lag@wire", "winkler", "viscous")),
    ],
)
def test_an_effect_beats_its_rivals_and_its_strength_is_found(
    effect: str, parameter: str, strength: float, rivals: tuple[str, ...]
) -> None:
    runs, _ = prepare(simulate({effect: {parameter: strength}}, LEVELS))
    model = RockingModel(runs[0].survey)
    null = fit(model, runs)
    fits = {name: fit(model, runs, (LIBRARY[name],), null.known()) for name in (effect, *rivals)}
    best = fits.pop(effect)
    assert best.log_evidence > null.log_evidence + 20
    for name, other in fits.items():
        assert best.log_evidence > other.log_evidence + 3, name
    _, low, high = best.values[f"{effect}.{parameter}"]
    middle, half = (low + high) / 2, (high - low) / 2
    assert abs(strength - middle) < 1.5 * half + 0.02 * strength


@pytest.mark.parametrize(
    "where", [{"loose": 0.05}, {"loose": 0.0, "release": 0.05}], ids=["one side", "release side"]
)
def test_a_cable_that_pulls_all_the_time_is_no_tilted_base(where: dict[str, float]) -> None:
    """It leans on one side alone where it is fixed, and on the side of each release where it is moved."""
    result = diagnose_runs(
        simulate({"taut_cable": {"k": 0.06, **where}}, LEVELS),
        only=("taut_cable", "base_tilt", "alpha_asymmetry", "residual_cable", "initial_velocity"),
    )
    assert result.decision.effects == ("taut_cable",)
    sizes = {p.name.partition(".")[2]: (p.low, p.high) for p in result.effect_parameters}
    for name, true in ({"k": 0.06, "release": 0.0} | where).items():
        low, high = sizes[name]
        assert abs(true - 0.5 * (low + high)) < 0.75 * (high - low), name


@pytest.mark.heavy
@pytest.mark.timeout(900)
def test_whole_diagnosis_of_a_viscous_wall() -> None:
    result = diagnose_runs(simulate({"viscous": {"zeta": 0.006}}, LEVELS))
    assert result.which[0].effects == ("viscous",)
    assert result.gap is not None
    assert result.gap.after < 1.3

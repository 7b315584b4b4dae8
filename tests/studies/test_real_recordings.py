"""The core on public recordings whose missing effect is known."""

from __future__ import annotations

from pathlib import Path

import pytest

DATA = Path(__file__).parents[2].parent / "shared" / "data" / "real"
pytestmark = pytest.mark.skipif(
    not DATA.is_dir(), reason="the folder shared/data/real is not beside the repository"
)


def test_drive_lacks_coulomb_friction_and_gives_the_published_parameters() -> None:
    from studies.real_gap import emps

    result = emps.run(DATA / "emps")
    assert result.from_mass.decision.verdict == "several"
    # The published model has a constant offset of the force too: friction that differs by direction.
    assert set(result.from_mass.decision.effects) == {"viscous", "coulomb", "asymmetry"}
    singles = [h for h in result.from_viscous.which if len(h.effects) == 1]
    assert singles[0].effects == ("coulomb",)
    assert singles[0].log_evidence > singles[1].log_evidence + 100
    assert "coulomb" in result.from_viscous.which[0].effects
    for name, (found, published) in result.published.items():
        assert found == pytest.approx(published, rel=0.02), name
    mass, viscous, coulomb, _ = (held_out for _, held_out in result.residuals.values())
    assert mass > 0.6
    assert viscous < 0.2
    assert coulomb < 0.05


@pytest.mark.heavy
def test_pendulum_loses_more_than_viscously_and_a_hand_holds_it_at_the_start() -> None:
    from studies.real_gap import pendulum

    result = pendulum.run(DATA / "free_swing_pendulum")
    assert result.loss.decision.verdict == "effect"
    assert result.loss.decision.family == "dissipation"
    assert (
        result.degrees["viscous + Coulomb"]
        < 0.35 * result.degrees["viscous"]
        < 0.1 * result.degrees["undamped"]
    )
    assert result.release.decision.effects == ("hand",)
    assert result.release.where.cells[0].phase == "release"
    assert result.hand_end_s["free_swing_01"] > 0.2, (
        "the first record starts 0.24 s before its first turning point"
    )

"""The mix of a check: shares, decks, and cases that do not depend on how many are made."""

from __future__ import annotations

import dataclasses
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from daq_app.config import Rig, load_rig
from daq_app.gap.blind.making.make import Order, check_apart, draw_case
from daq_app.gap.blind.making.mix import case_generator, category_of, draw_effects
from daq_app.gap.blind.names import accepted_names
from daq_app.gap.blind.world.effects.catalogue import ENTRIES, LIBRARY, OUTSIDE


@pytest.fixture(scope="module")
def rig(configs: Path) -> Rig:
    return load_rig(configs / "fr1.toml")


def test_two_hundred_cases_have_the_mix_of_the_design(rig: Rig) -> None:
    counts = Counter(category_of(4, k) for k in range(200))
    assert counts == {"single": 110, "pair": 30, "outside": 40, "null": 20}
    hidden = [draw_effects(4, k, rig, case_generator(4, k)) for k in range(200)]
    singles = Counter(e[0].name for k, e in enumerate(hidden) if category_of(4, k) == "single")
    assert set(singles) == set(LIBRARY)  # each comes up before any comes up much more often
    assert max(singles.values()) - min(singles.values()) <= 1
    outside = Counter(e[0].name for k, e in enumerate(hidden) if category_of(4, k) == "outside")
    assert set(outside) == set(OUTSIDE)
    for k, effects in enumerate(hidden):
        if category_of(4, k) == "pair":
            assert len({e.family for e in effects}) == 2
    strengths = [e[0].strength for k, e in enumerate(hidden) if category_of(4, k) == "single"]
    assert np.histogram(strengths, 4, (0, 1))[0].min() > 10


def test_the_outside_has_near_and_far_effects_and_every_family_is_there() -> None:
    kinds = Counter(ENTRIES[name].kind for name in OUTSIDE)
    assert kinds["near"] >= 4 and kinds["far"] >= 4 and sum(kinds.values()) >= 8
    assert {entry.family for entry in ENTRIES.values()} == {
        "interface",
        "restitution",
        "dissipation",
        "geometry",
        "contact",
        "structure",
        "release",
        "ambient",
        "sensor",
    }
    assert not set(LIBRARY) & set(OUTSIDE)


def test_a_case_depends_on_seed_and_place_only(configs: Path, tmp_path: Path) -> None:
    texts = ((configs / "fr1.toml").read_text(encoding="utf-8"),)
    order = Order(9, tmp_path / "a", tmp_path / "b", texts)
    first, again = draw_case(order, 7)[0], draw_case(order, 7)[0]
    assert (first.wall, first.effects, first.runs) == (again.wall, again.effects, again.runs)
    other = draw_case(dataclasses.replace(order, seed=10), 7)[0]
    assert first.wall != other.wall


def test_walls_levels_and_scatter_vary_within_what_a_survey_leaves_open(
    configs: Path, tmp_path: Path
) -> None:
    texts = ((configs / "fr1.toml").read_text(encoding="utf-8"),)
    worlds = [draw_case(Order(2, tmp_path / "a", tmp_path / "b", texts), k)[0] for k in range(40)]
    alpha = np.array([w.wall.alpha for w in worlds]) / worlds[0].rig.specimen.alpha0_rad
    assert 0.005 < alpha.std() < 0.02
    scatter = [w.wall.restitution_scatter for w in worlds]
    assert min(scatter) >= 0.002 and max(scatter) <= 0.008
    for world in worlds:
        assert {run.level for run in world.runs} == {"L1", "L2", "L3", "L4"}
        assert len({run.test for run in world.runs}) == len(world.runs) == 6
        assert all(run.hold_s >= 2.0 for run in world.runs)


def test_labels_within_reach_are_refused(tmp_path: Path) -> None:
    for labels in (tmp_path, tmp_path / "labels"):
        with pytest.raises(ValueError, match="must not lie within"):
            check_apart(tmp_path, labels)
    check_apart(tmp_path / "cases", tmp_path / "labels")


def test_what_no_sensor_tells_apart_is_accepted_both_ways() -> None:
    assert "base_tilt" in accepted_names("eccentric_mass")
    assert "eccentric_mass" in accepted_names("base_tilt")
    assert accepted_names("viscous") == ("viscous",)

"""Positions that no wall has are said with their numbers; positions that a wall has are not."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st

from daq_app.config import load_rig, parse_rig, plan_tasks

Tables = dict[str, Any]
Move = Callable[[dict[str, Any]], None]
CONFIGS = Path(__file__).parents[2] / "configs"


def warnings_of(tables: Tables) -> list[tuple[str, str]]:
    notes = plan_tasks(parse_rig(tomli_w.dumps(tables))).notes
    return [
        (note.where, note.text)
        for note in notes
        if "Check position_m" in note.text or "anchor_m" in note.text
    ]


def moved(tables: Tables, family: str, move: Move) -> Tables:
    for channel in tables["channels"]:
        if channel["family"] == family:
            move(channel)
    return tables


def outwards(by_m: float) -> Move:
    def move(channel: dict[str, Any]) -> None:
        x, y, z = channel["position_m"]
        channel["position_m"] = [x + by_m * (1 if x > 0 else -1), y, z]

    return move


def upwards(by_m: float) -> Move:
    def move(channel: dict[str, Any]) -> None:
        x, y, z = channel["position_m"]
        channel["position_m"] = [x, y, z + by_m]

    return move


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.toml")), ids=lambda path: path.stem)
def test_nothing_is_said_of_the_rigs_that_come_with_the_program(path: Path) -> None:
    assert [
        n for n in plan_tasks(load_rig(path)).notes if "position_m" in n.text or "anchor_m" in n.text
    ] == []


def test_lvdts_off_the_faces_are_named_with_the_distance(fr1: Tables) -> None:
    ((where, text),) = warnings_of(moved(fr1, "lvdt", outwards(0.075)))
    assert "24 channels" in where
    assert "75 mm off the faces" in text


def test_wires_above_the_top_are_named_with_the_height(fr1: Tables) -> None:
    ((where, text),) = warnings_of(moved(fr1, "wire", upwards(0.6)))
    assert "WP-" in where
    assert "2.90 m" in text


def test_openings_of_one_face_alone_cannot_tell_the_rotation(fr1: Tables) -> None:
    fr1["channels"] = [c for c in fr1["channels"] if not c["id"].startswith("LV-B")]
    fr1["expected_channels"]["lvdt"] = 12
    notes = plan_tasks(parse_rig(tomli_w.dumps(fr1))).notes
    assert [n for n in notes if "one face alone" in n.text]


def test_a_steep_wire_hardly_sees_the_wall(fr1: Tables) -> None:
    wire = next(c for c in fr1["channels"] if c["family"] == "wire")
    x, y, z = wire["position_m"]
    wire["anchor_m"] = [x - 0.5, y, z + 2.0]
    ((where, text),) = warnings_of(fr1)
    assert where == wire["id"]
    assert "45°" in text


@given(by_m=st.floats(-0.3, 0.3).filter(lambda by: abs(abs(by) - 0.02) > 1e-3))
@settings(max_examples=25, deadline=None)
def test_a_distance_is_said_exactly_where_no_bracket_makes_it(by_m: float) -> None:
    tables = tomllib.loads((CONFIGS / "fr1.toml").read_text(encoding="utf-8"))
    said = warnings_of(moved(tables, "lvdt", outwards(by_m)))
    assert bool(said) == (abs(by_m) > 0.02)

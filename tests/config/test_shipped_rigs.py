"""The rigs that ship are runnable as they are, and say what the paper says."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import pytest

from daq_app.config import Rig, Scaling, load_rig, plan_tasks

NAMES = ("fr1", "fr2", "fr1-iepe", "fr1-pxie", "original")


@pytest.fixture(params=NAMES)
def rig(request: pytest.FixtureRequest, configs: Path) -> Rig:
    return load_rig(configs / f"{request.param}.toml")


def test_has_the_41_channels_of_the_paper(rig: Rig) -> None:
    counts = [len(rig.of_family(f)) for f in ("lvdt", "wire", "accelerometer", "tiltmeter")]
    assert counts == [24, 5, 8, 4]
    half = rig.specimen.base_width_m / 2
    faces = [round(c.position_m[0] / half) for c in rig.of_family("lvdt")]
    assert faces.count(-1) == faces.count(1) == 12
    heights = {c.position_m[2] for c in rig.of_family("wire")}
    assert len(heights) >= 4
    top = [c for c in rig.of_family("wire") if c.position_m[2] == max(heights)]
    assert len(top) == 2
    assert top[0].position_m[1] * top[1].position_m[1] < 0


def test_every_value_without_a_source_is_marked(rig: Rig, configs: Path) -> None:
    """The paper gives weights, geometry and mortar; nothing of sensors, length or modules."""
    assert "length_m" in rig.specimen.assumed
    assert "chassis" in rig.hardware.assumed
    for channel in rig.channels:
        assert {"position_m", "sensitivity", "range_si", "certificate"} <= set(channel.assumed)


@pytest.mark.parametrize(
    ("name", "weight_kn", "inertia", "r0", "p", "alpha"),
    [
        ("original", 48.2, 15426, 1.535, 2.19, 0.213),
        ("fr1", 51.3, 16107, 1.525, 2.20, 0.215),
        ("fr2", 52.8, 17652, 1.574, 2.17, 0.208),
    ],
)
def test_specimen_is_table_3_1(
    configs: Path, name: str, weight_kn: float, inertia: float, r0: float, p: float, alpha: float
) -> None:
    s = load_rig(configs / f"{name}.toml").specimen
    assert (s.weight_n, s.rotational_inertia_kg_m2, s.r0_m, s.p_rad_s, s.alpha0_rad) == (
        pytest.approx(1e3 * weight_kn),
        inertia,
        r0,
        p,
        alpha,
    )


def test_no_sensor_clips_at_the_largest_release(rig: Rig) -> None:
    """θ0/α = 0.40 and 20 % more, to both sides: opening, wire and tilt stay within their ranges."""
    s = rig.specimen
    for theta in (1.2 * 0.40 * s.alpha0_rad, -1.2 * 0.40 * s.alpha0_rad):
        pivot = math.copysign(s.base_width_m / 2, theta)
        for channel in rig.channels:
            x, y, z = channel.position_m
            dx, dz = x - pivot, z
            moved = (
                pivot + dx * math.cos(theta) + dz * math.sin(theta),
                y,
                dz * math.cos(theta) - dx * math.sin(theta),
            )
            if channel.family == "lvdt":
                value = moved[2] - z
            elif channel.family == "wire":
                assert channel.anchor_m is not None
                value = math.dist(channel.anchor_m, channel.position_m) - math.dist(channel.anchor_m, moved)
            elif channel.family == "tiltmeter" and channel.axis == "x":
                value = theta
            else:
                continue
            assert channel.range_si[0] < value < channel.range_si[1], (channel.id, value)


def test_readings_over_the_range_come_back_as_si(rig: Rig) -> None:
    import numpy as np

    scaling = Scaling.of(rig.channels)
    ends = np.array([channel.range_si for channel in rig.channels])
    assert np.allclose(scaling.to_si(scaling.to_readings(ends)), ends, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "rate", "tasks"),
    [("fr1", 4000.0, 1), ("fr2", 4000.0, 1), ("fr1-iepe", 51200 / 12, 1), ("fr1-pxie", 4000.0, 2)],
)
def test_plans_at_the_rate_of_its_hardware(configs: Path, name: str, rate: float, tasks: int) -> None:
    plan = plan_tasks(load_rig(configs / f"{name}.toml"))
    assert plan.rate_hz == pytest.approx(rate, abs=1e-9)
    assert len(plan.tasks) == tasks


def test_defaults_keep_the_files_short(configs: Path) -> None:
    text = (configs / "fr1.toml").read_text(encoding="utf-8")
    assert len(tomllib.loads(text)["channels"]) == 41
    assert text.count("sensitivity_unit") == 4

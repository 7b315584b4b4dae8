"""Rotation from wires by true geometry, against a forward model written for the test."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq_app.rocking import RotationGeometry


def turn(point, theta, half):
    """The wall point after a rotation about the edge it turns on, by a plain rotation matrix."""
    pivot = np.array([half if theta >= 0 else -half, 0.0])
    arm = np.array([point[0], point[2]]) - pivot
    c, s = math.cos(theta), math.sin(theta)
    x, z = pivot + np.array([[c, s], [-s, c]]) @ arm
    return np.array([x, point[1], z])


def shortening(channel, theta, half):
    anchor, start = np.array(channel.anchor_m), np.array(channel.position_m)
    return np.linalg.norm(anchor - start) - np.linalg.norm(anchor - turn(channel.position_m, theta, half))


def with_wires(rig, **changes):
    """The rig with every wire's anchor changed by a function of the channel."""
    channels = tuple(
        channel.model_copy(update={key: value(channel) for key, value in changes.items()})
        if channel.family == "wire"
        else channel
        for channel in rig.channels
    )
    return rig.model_copy(update={"channels": channels})


ANCHORS = {
    "as shipped": lambda c: c.anchor_m,
    "on the other side": lambda c: (-3.0, c.position_m[1], c.position_m[2]),
    "from the floor": lambda c: (2.5, c.position_m[1] + 0.3, 0.2),
    "short wires": lambda c: (0.9, c.position_m[1], c.position_m[2] + 0.1),
}


@pytest.mark.parametrize("anchor", ANCHORS)
@given(theta=st.floats(-0.12, 0.12))
def test_rotation_is_inverted_exactly(fr1, anchor, theta):
    rig = with_wires(fr1, anchor_m=ANCHORS[anchor])
    half = rig.specimen.base_width_m / 2
    readings = np.array([[shortening(wire, theta, half)] for wire in rig.of_family("wire")])
    result = RotationGeometry.from_rig(rig).rotation(readings)
    assert result.rotation_rad[0] == pytest.approx(theta, abs=1e-9)
    assert abs(result.twist_rad[0]) < 1e-9


def test_small_angle_shortcut_would_be_wrong(fr1):
    """z sin θ misses what the true geometry sees: the test above would fail with it."""
    wire = with_wires(fr1, anchor_m=ANCHORS["short wires"]).of_family("wire")[4]
    half = fr1.specimen.base_width_m / 2
    error = math.asin(shortening(wire, 0.086, half) / wire.position_m[2]) - 0.086
    assert abs(error) > 0.002 * 0.086


def test_twist_is_seen_and_does_not_touch_rotation(fr1):
    geometry = RotationGeometry.from_rig(fr1)
    half = fr1.specimen.base_width_m / 2
    twist = 2e-3
    readings = []
    for wire in fr1.of_family("wire"):
        anchor, point = np.array(wire.anchor_m), turn(wire.position_m, 0.05, half)
        point[0] -= twist * point[1]  # about the vertical axis, small
        start = np.linalg.norm(anchor - np.array(wire.position_m))
        readings.append([start - np.linalg.norm(anchor - point)])
    result = geometry.rotation(np.array(readings))
    assert result.rotation_rad[0] == pytest.approx(0.05, abs=1e-6)
    assert result.twist_rad[0] == pytest.approx(twist, rel=0.02)


def test_noise_of_the_combination_is_as_stated_and_below_any_single_wire(fr1):
    geometry = RotationGeometry.from_rig(fr1)
    rng = np.random.default_rng(0)
    noise = np.array([wire.noise_si for wire in fr1.of_family("wire")])
    readings = geometry.wires.shortening(0.04) + rng.normal(size=(5, 40_000)) * noise[:, None]
    result = geometry.rotation(readings)
    assert result.rotation_rad.std() == pytest.approx(geometry.rotation_noise_rad(), rel=0.03)
    assert geometry.rotation_noise_rad() < np.min(noise / geometry.wires.lever_m) * 0.75


@pytest.mark.parametrize("value", [0.0, 0.2, np.nan, np.inf])
@pytest.mark.parametrize("row", range(5))
def test_any_single_bad_wire_is_left_out(fr1, row, value):
    geometry = RotationGeometry.from_rig(fr1)
    readings = np.repeat(geometry.wires.shortening(0.05), 200, axis=1)
    readings[row, 60:] = value
    result = geometry.rotation(readings)
    np.testing.assert_allclose(result.rotation_rad[:60], 0.05, atol=1e-9)
    np.testing.assert_allclose(result.rotation_rad[80:], 0.05, atol=1e-9)
    assert result.excluded[row, 80:].all()
    assert not np.delete(result.excluded, row, axis=0).any()


def test_a_gap_in_all_wires_is_nan(fr1):
    geometry = RotationGeometry.from_rig(fr1)
    readings = np.repeat(geometry.wires.shortening(0.05), 100, axis=1)
    readings[:, 40:60] = np.nan
    rotation = geometry.rotation(readings).rotation_rad
    assert (
        np.isnan(rotation[40:60]).all()
        and np.isfinite(rotation[:40]).all()
        and np.isfinite(rotation[60:]).all()
    )


def test_time_offset_is_that_of_the_weighted_wires(fr1):
    geometry = RotationGeometry.from_rig(fr1)
    assert geometry.time_offset_s({}) == 0.0
    same = {wire.id: 2e-5 for wire in fr1.of_family("wire")}
    assert geometry.time_offset_s(same) == pytest.approx(2e-5)


def test_tilt_prefers_the_tiltmeter_that_agrees_with_the_wires(fr1):
    geometry = RotationGeometry.from_rig(fr1)
    assert geometry.tilt(np.array([[0.05], [0.0502]])) == pytest.approx(0.0501)
    assert geometry.tilt(np.array([[0.05], [0.0]]), 0.0499) == pytest.approx(0.05)
    assert geometry.tilt(np.array([[0.05], [np.nan]])) == pytest.approx(0.05)


def test_rigs_that_cannot_give_rotation_are_refused_in_words(fr1):
    none = fr1.model_copy(update={"channels": tuple(c for c in fr1.channels if c.family != "wire")})
    with pytest.raises(ValueError, match="no wire potentiometers"):
        RotationGeometry.from_rig(none)
    with pytest.raises(ValueError, match=r"anchor_m.*WP-1"):
        RotationGeometry.from_rig(with_wires(fr1, anchor_m=lambda c: None))
    with pytest.raises(ValueError, match="length is zero"):
        RotationGeometry.from_rig(with_wires(fr1, anchor_m=lambda c: c.position_m))

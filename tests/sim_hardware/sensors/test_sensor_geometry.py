"""Each family against what its sensor must read, written out independently of the kernels."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from daq_app.config import load_rig
from daq_app.config.rig import G_M_S2, Rig
from daq_app.config.scaling import Scaling
from sim_hardware.direct import electrical_per_reading
from sim_hardware.dynamics import Body, Motion, Release, Restitution, simulate_motion
from sim_hardware.dynamics.pieces import constant_piece
from sim_hardware.sensors import Scene, SensorChain
from sim_hardware.sensors import layout as la

RELEASE_S = 2.0


@pytest.fixture(scope="module")
def rig(configs: Path) -> Rig:
    return load_rig(configs / "fr1.toml")


@pytest.fixture(scope="module")
def body(rig: Rig) -> Body:
    return Body.from_specimen(rig.specimen)


def scene_of(rig: Rig, motion: Motion) -> Scene:
    """Held at θ₀ for ever, then released."""
    held = Scene.upright(motion.vector, rig.specimen.height_m)
    held = held.with_path(constant_piece(-1e8, motion.theta0_rad)[None, :])
    return held.with_motion(motion, RELEASE_S)


def released(rig: Rig, body: Body, theta0: float, **effects: dict[str, float]) -> tuple[Motion, Scene]:
    motion = simulate_motion(body, Release(theta0), Restitution(0.9), effects)
    return motion, scene_of(rig, motion)


def between_impacts(motion: Motion, n: int = 400) -> np.ndarray:
    """Times of the motion (from release) that are not just after an impact, where transients live."""
    times = np.linspace(0.0, motion.impact_time_s[6], n)
    since = times[:, None] - motion.impact_time_s[None, :]
    return np.asarray(times[~np.any((since > -1e-9) & (since < 0.07), axis=1)])


@pytest.mark.parametrize("theta0", [0.075, -0.075])
def test_lvdts_read_the_opening_above_the_joint(rig: Rig, body: Body, theta0: float) -> None:
    motion, scene = released(rig, body, theta0)
    times = between_impacts(motion)
    theta = motion.rotation(times)
    quantities = SensorChain(rig, 1).quantities(scene, times + RELEASE_S)
    for i, channel in enumerate(rig.channels):
        if channel.family == "lvdt":
            pivot = np.sign(theta) * body.half_base_m
            np.testing.assert_allclose(
                quantities[i], (pivot - channel.position_m[0]) * np.sin(theta), atol=1e-9
            )
            assert quantities[i].min() > -1e-4


def test_wires_read_the_shortening_of_the_true_chord(rig: Rig, body: Body) -> None:
    motion, scene = released(rig, body, 0.08)
    times = between_impacts(motion)
    theta = motion.rotation(times)
    quantities = SensorChain(rig, 1).quantities(scene, times + RELEASE_S)
    for i, channel in enumerate(rig.channels):
        if channel.family != "wire":
            continue
        x, y, z = channel.position_m
        ax, ay, az = channel.anchor_m or (0.0, 0.0, 0.0)
        pivot = np.sign(theta) * body.half_base_m
        px = pivot + (x - pivot) * np.cos(theta) + z * np.sin(theta)
        pz = -(x - pivot) * np.sin(theta) + z * np.cos(theta)
        start = math.dist((x, y, z), (ax, ay, az))
        expected = start - np.sqrt((px - ax) ** 2 + (y - ay) ** 2 + (pz - az) ** 2)
        np.testing.assert_allclose(quantities[i], expected, atol=1e-12)
        moves_towards_anchor = (theta > 0) == (ax > x)
        assert np.all((quantities[i] > 0) == moves_towards_anchor)


def test_accelerometers_read_specific_force_along_the_walls_axes(rig: Rig, body: Body) -> None:
    """Against the second difference of the sensor's own position, turned into the wall's frame."""
    motion, scene = released(rig, body, 0.08)
    times = between_impacts(motion)
    times = times[(times > 0.01)]
    h = 1e-4
    quantities = SensorChain(rig, 1).quantities(scene, times + RELEASE_S)

    def position(t: np.ndarray, x: float, z: float) -> tuple[np.ndarray, np.ndarray]:
        theta = motion.rotation(t)
        pivot = np.sign(theta) * body.half_base_m
        px = pivot + (x - pivot) * np.cos(theta) + z * np.sin(theta)
        return px, -(x - pivot) * np.sin(theta) + z * np.cos(theta)

    apart = np.min(np.abs(times[:, None] - motion.impact_time_s[None, :]), axis=1) > 2 * h
    checked = 0
    for i, channel in enumerate(rig.channels):
        if channel.family != "accelerometer":
            continue
        x, _, z = channel.position_m
        before, now, after = (position(times + k * h, x, z) for k in (-1, 0, 1))
        ax, az = ((before[c] - 2 * now[c] + after[c]) / h**2 for c in (0, 1))
        theta = motion.rotation(times)
        along = {
            "x": ax * np.cos(theta) - (az + G_M_S2) * np.sin(theta),
            "z": ax * np.sin(theta) + (az + G_M_S2) * np.cos(theta) - G_M_S2,
            "y": np.zeros_like(theta),
        }[channel.axis]
        np.testing.assert_allclose(quantities[i][apart], along[apart], atol=2e-5)
        checked += channel.axis in ("x", "z")
    assert checked >= 4


def test_an_impact_is_a_pulse_of_the_velocity_jump_and_rings_away(rig: Rig, body: Body) -> None:
    motion, scene = released(rig, body, 0.08)
    impact = motion.impact_time_s[0]
    jump = motion.velocity_after_rad_s[0] - motion.velocity_before_rad_s[0]
    times = impact + np.arange(-0.02, 0.12, 1 / 100_000)
    quantities = SensorChain(rig, 1).quantities(scene, times + RELEASE_S)
    smooth = SensorChain(rig, 1).quantities(scene, np.array([impact - 1e-6, impact + 0.1]) + RELEASE_S)
    for i, channel in enumerate(rig.channels):
        if channel.family != "accelerometer" or channel.axis != "x":
            continue
        transient = quantities[i] - np.where(times < impact, smooth[i, 0], smooth[i, 1])
        area = np.sum(transient[(times >= impact) & (times < impact + 0.07)]) / 100_000
        assert area == pytest.approx(jump * channel.position_m[2], abs=0.25 * abs(jump) * 3)
        peak = np.abs(transient[times >= impact]).max()
        assert 5.0 < peak < 0.9 * channel.range_si[1]
        assert np.abs(transient[times < impact]).max() < 0.6
        late = np.abs(transient[(times > impact + 0.03) & (times < impact + 0.05)]).max()
        assert late < 0.1 * peak


def test_slow_tiltmeters_follow_with_their_time_constant(rig: Rig, body: Body) -> None:
    motion, scene = released(rig, body, 0.08)
    channel = next(c for c in rig.channels if c.family == "tiltmeter" and c.axis == "x")
    times = np.arange(0.0, 6.0, 1 / 4000)
    chain = SensorChain(rig, 1)
    volts = chain.volts(scene, (channel.physical_channel,), times, noisy=False)
    seen = Scaling.of([channel]).to_si(volts)[0]
    seen -= seen[0]
    # integrate τ ẏ = θ − y independently, ten times finer
    fine = np.arange(0.0, 6.0, 1 / 40_000)
    theta = motion.rotation(fine + 0.5 / 40_000 - RELEASE_S)
    y, expected = theta[0], np.empty(fine.size)
    decay = math.exp(-1 / 40_000 / channel.time_constant_s)
    for k in range(fine.size):
        expected[k] = y
        y = theta[k] + (y - theta[k]) * decay
    np.testing.assert_allclose(seen, expected[::10] - expected[0], atol=2e-7)


def test_a_moved_pivot_closes_the_joint_outside_it(rig: Rig, body: Body) -> None:
    _, scene = released(rig, body, 0.08, pivot_shift={"a": 0.03})
    quantities = SensorChain(rig, 1).quantities(scene, np.array([1.0]))
    for i, channel in enumerate(rig.channels):
        if channel.family == "lvdt":
            expected = (body.half_base_m - 0.03 - channel.position_m[0]) * math.sin(0.08)
            assert quantities[i, 0] == pytest.approx(expected, abs=1e-12)
    compressed = [quantities[i, 0] for i, c in enumerate(rig.channels) if c.position_m[0] > 0.3 and i < 24]
    assert compressed
    assert max(compressed) < -1e-3


def test_a_compliant_joint_compresses_at_the_toe_and_is_continuous_at_uplift(rig: Rig, body: Body) -> None:
    theta_c = 5e-4
    _, scene = released(rig, body, 0.05, winkler={"theta_c": theta_c})
    chain = SensorChain(rig, 1)
    vector_scene = scene.cut(RELEASE_S)
    lvdts = [i for i, c in enumerate(rig.channels) if c.family == "lvdt"]
    xs = np.array([rig.channels[i].position_m[0] for i in lvdts])

    def openings(theta: float) -> np.ndarray:
        held = vector_scene.with_path(constant_piece(0.5, theta)[None, :])
        return np.asarray(chain.quantities(held, np.array([1.0]))[lvdts, 0])

    np.testing.assert_allclose(openings(0.4 * theta_c), -xs * math.sin(0.4 * theta_c), atol=1e-12)
    below, above = openings(theta_c * (1 - 1e-7)), openings(theta_c * (1 + 1e-7))
    np.testing.assert_allclose(below, above, atol=1e-9)
    at_toe = openings(0.05)[xs > 0.3]
    assert np.all(at_toe < -theta_c * body.half_base_m)


def test_a_rolling_edge_keeps_contact_with_the_ground(rig: Rig, body: Body) -> None:
    """The lowest point of the rounded base stays at height 0, and the roll does not slip."""
    rho = 0.05
    _, scene = released(rig, body, 0.05, rounded_edge={"rho": rho})
    held = scene.cut(RELEASE_S).with_path(constant_piece(0.5, 0.07)[None, :])
    state = SensorChain(rig, 1).states(held, np.array([1.0]))[:, 0]
    u, theta = body.half_base_m, 0.07
    # centre of the circle, in the wall at (u − ρ, ρ)
    cx = (u - rho) * math.cos(theta) + rho * math.sin(theta) + state[la.ST_UX]
    cz = -(u - rho) * math.sin(theta) + rho * math.cos(theta) + state[la.ST_UZ]
    assert cz == pytest.approx(rho, abs=1e-12)
    assert cx == pytest.approx(u - rho + rho * theta, abs=1e-12)


def test_readings_scale_back_to_the_quantity_for_every_measurement(configs: Path) -> None:
    """Polarity, offset, sensitivity and native units: volts through the certificate give the quantity."""
    for name in ("fr1", "fr2", "fr1-iepe", "fr1-pxie"):
        rig = load_rig(configs / f"{name}.toml")
        plain = rig.model_copy(
            update={"simulation": rig.simulation.model_copy(update={"offset_scatter": 0.0})}
        )
        body = Body.from_specimen(rig.specimen)
        _, scene = released(plain, body, 0.06)
        chain = SensorChain(plain, 1)
        times = np.array([1.0, 1.5])
        true = chain.quantities(scene, times)
        for i, channel in enumerate(rig.channels):
            volts = chain.volts(scene, (channel.physical_channel,), times, noisy=False)
            seen = Scaling.of([channel]).to_si(volts / electrical_per_reading(channel))[0]
            if channel.measurement != "iepe" and not (channel.family == "tiltmeter" and channel.axis == "y"):
                np.testing.assert_allclose(seen, true[i], atol=1e-9)

"""The independent sensors: geometry, and what each hidden effect changes and what it leaves alone."""

from __future__ import annotations

import dataclasses
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from daq_app.config import Rig, Scaling, load_rig
from daq_app.gap.blind.world.campaign import PlannedRun, World, draw_world
from daq_app.gap.blind.world.effects.catalogue import ENTRIES, Drawn, draw
from daq_app.gap.blind.world.sensors.chain import quiet_signals, within_range
from daq_app.gap.blind.world.sensors.faults import ELECTRONICS, Fault, Place
from daq_app.gap.blind.world.wall import Wall

THETA0 = 0.05
RATE_HZ = 400.0
NO_ZERO = {"polarity", "swap", "wire_inertia", "dropout", "clock"}
"""Effects without a strength that can vanish, or that act on the clock of the record."""


@pytest.fixture(scope="module")
def rig(configs: Path) -> Rig:
    return load_rig(configs / "fr1.toml")


def world_with(rig: Rig, *effects: Drawn) -> World:
    """One run of an exactly known wall that loses much at impacts, hence is short."""
    drawn = draw_world(rig, effects, 1, np.random.default_rng(3))
    wall = Wall.nominal(rig.specimen, 0.7)
    run = PlannedRun("FR1-L2-1", "L2", THETA0, 1, 0.5, 0.0, 11, 600.0)
    return dataclasses.replace(drawn, wall=wall, runs=(run,))


def signals(world: World) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(time, quiet SI signals) of the run."""
    course = world.course(0, 40)
    time = np.arange(-0.5, 3.0, 1.0 / RATE_HZ)
    scene = course.scene(time)
    rng = np.random.default_rng(1)
    return time, quiet_signals(world.rig, scene, world.faults, rng, Place(600.0, THETA0))


def effect(rig: Rig, name: str, strength: float | None = None, value: float | None = None) -> Drawn:
    found = draw(ENTRIES[name], rig, np.random.default_rng(8), strength)
    if value is None:
        return found
    return dataclasses.replace(found, parameters={**found.parameters, ENTRIES[name].parameter: value})


def row(rig: Rig, values: NDArray[np.float64], channel: str) -> NDArray[np.float64]:
    return values[rig.channel_ids.index(channel)]


def test_a_held_wall_reads_what_geometry_says(rig: Rig) -> None:
    time, found = signals(world_with(rig))
    held = time < -0.01
    half = rig.specimen.base_width_m / 2.0
    for name in ("LV-A03", "LV-B07"):
        x = rig.channel(name).position_m[0]
        expected = (half - x) * math.sin(THETA0)
        assert row(rig, found, name)[held] == pytest.approx(expected, abs=1e-12)
    wire = rig.channel("WP-4")
    (x, y, z), anchor = wire.position_m, wire.anchor_m
    assert anchor is not None
    turned = (
        half + (x - half) * math.cos(THETA0) + z * math.sin(THETA0),
        y,
        -(x - half) * math.sin(THETA0) + z * math.cos(THETA0),
    )
    expected = math.dist(anchor, (x, y, z)) - math.dist(anchor, turned)
    assert row(rig, found, "WP-4")[held] == pytest.approx(expected, abs=1e-12)
    assert row(rig, found, "AC-3")[held] == pytest.approx(-9.80665 * math.sin(THETA0), abs=1e-9)
    assert row(rig, found, "TL-1X")[held] == pytest.approx(THETA0, abs=1e-12)
    assert not row(rig, found, "TL-1Y").any()


def test_upright_at_rest_all_channels_are_zero(rig: Rig) -> None:
    time, found = signals(world_with(rig))
    end = time > 2.95
    fast = [c.family != "tiltmeter" for c in rig.channels]
    assert np.abs(found[fast][:, end]).max() < 1e-9


def test_an_accelerometer_feels_height_times_angular_acceleration(rig: Rig) -> None:
    world = world_with(rig)
    time, found = signals(world)
    falling = (time > 0.02) & (time < 0.2)
    theta, omega, theta_dd = world.course(0, 40).motion.sample(time)
    x, _, z = rig.channel("AC-4").position_m
    arm = x - rig.specimen.base_width_m / 2.0
    expected = theta_dd * z - omega**2 * arm - 9.80665 * np.sin(theta)
    assert row(rig, found, "AC-4")[falling] == pytest.approx(expected[falling], abs=1e-9)


def test_reversed_leads_reverse_the_range_of_a_sensor_as_well(rig: Rig) -> None:
    lvdt, signal = rig.channel("LV-B12"), np.linspace(-0.2, 0.2, 401)
    sound = within_range(signal, lvdt, ())
    assert (sound.min(), sound.max()) == lvdt.range_si
    turned = within_range(-signal, lvdt, (Fault("polarity", {"on": 1.0}, ("LV-B12",)),))
    np.testing.assert_array_equal(turned, -sound)


@pytest.mark.parametrize("name", ["lag", "filter_delay", "slow_response"])
@pytest.mark.parametrize("tau_s", [0.0051, 0.0137])
def test_a_late_sensor_is_late_by_what_its_label_says(rig: Rig, name: str, tau_s: float) -> None:
    """Between a signal and itself later lies its whole change times the mean delay, whatever the response."""
    _, plain = signals(world_with(rig))
    _, late = signals(world_with(rig, effect(rig, name, value=tau_s)))
    changed = np.flatnonzero(np.abs(late - plain).max(axis=1) > 1e-6)
    assert changed.size
    for k in changed:
        area = (plain[k] - late[k]).sum() / RATE_HZ
        assert area / (plain[k, -1] - plain[k, 0]) == pytest.approx(tau_s, abs=1e-6)


@pytest.mark.parametrize("name", sorted(set(ENTRIES) - NO_ZERO - set(ELECTRONICS)))
def test_an_effect_without_strength_changes_nothing(rig: Rig, name: str) -> None:
    _, plain = signals(world_with(rig))
    nothing = {"saturation": -1e6, "slow_release": 1e-9}.get(name, 1e-12)
    _, found = signals(world_with(rig, effect(rig, name, value=nothing)))
    quiet = [c.family != "accelerometer" for c in rig.channels]  # shocks move by a sample at most
    assert np.abs(found - plain)[quiet].max() < 1e-5


@pytest.mark.parametrize("name", sorted(set(ENTRIES) - set(ELECTRONICS) - {"clock"}))
def test_a_strong_effect_changes_what_it_should(rig: Rig, name: str) -> None:
    drawn = effect(rig, name, strength=0.9)
    world = world_with(rig, drawn)
    if name == "sudden_crack":
        world = dataclasses.replace(world, runs=(world.runs[0], world.runs[0]))
    _, plain = signals(world_with(rig))
    _, found = signals(world)
    if name == "sudden_crack":
        first, second = (world.course(k, 40).motion.impacts[-1].time for k in (0, 1))
        assert second != pytest.approx(first, abs=1e-4)
        return
    noise = np.array([c.noise_si for c in rig.channels])
    changed = np.abs(found - plain).max(axis=1) > noise
    if drawn.targets:
        # A fault shows on its channels and leaves every other sample of the rig alone.
        others = [c.id not in drawn.targets for c in rig.channels]
        assert changed.any()
        assert np.array_equal(found[others], plain[others])
    else:
        assert changed.sum() >= 2


def test_wires_alone_see_the_slip_and_the_joint_does_not(rig: Rig) -> None:
    _, plain = signals(world_with(rig))
    _, found = signals(world_with(rig, effect(rig, "sliding", strength=1.0)))
    moved = {
        c.family for c, d in zip(rig.channels, np.abs(found - plain).max(axis=1), strict=True) if d > 1e-6
    }
    assert moved == {"wire"}


def test_readings_are_quantised_tared_and_repeat_with_their_seed(rig: Rig) -> None:
    world = world_with(rig)
    first, again = next(world.make()).readings, next(world.make()).readings
    assert np.array_equal(first, again)
    si = Scaling.of(rig.channels, world.calibration.tare_reading).to_si(first)
    rest = si[:, -2000:]
    noise = np.array([c.noise_si for c in rig.channels])
    fast = np.array([c.family != "tiltmeter" for c in rig.channels])
    assert np.all(np.abs(rest.mean(axis=1))[fast] < 1.0 * noise[fast])
    assert rest.std(axis=1)[fast] == pytest.approx(noise[fast], rel=0.25)
    other = dataclasses.replace(world, runs=(dataclasses.replace(world.runs[0], seed=12),))
    assert not np.array_equal(first, next(other.make()).readings)


def test_a_fast_clock_shortens_the_record(rig: Rig) -> None:
    world = world_with(rig, effect(rig, "clock", value=0.05))
    made, plain = next(world.make()), next(world_with(rig).make())
    first_impact = [m.motion.impacts[0].time for m in (made, plain)]
    assert first_impact[0] == first_impact[1]  # the wall does not care
    wire = rig.channel_ids.index("WP-4")
    moments = []
    for m in (made, plain):
        drawn = m.readings[wire] - m.readings[wire][-500:].mean()
        held = drawn[:1000].mean()
        moments.append(int(np.argmax(drawn / held < 0.5)))
    assert (moments[0] - 0.5 * 4000) / (moments[1] - 0.5 * 4000) > 1.0


def test_the_world_shares_no_code_with_what_it_checks() -> None:
    code = (
        "import sys, daq_app.gap.blind.world.campaign;"
        "known=('sim_hardware','daq_app.gap.core','daq_app.gap.rocking_model');"
        "bad=[m for m in sys.modules if m.startswith(known)];"
        "sys.exit(str(bad) if bad else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr

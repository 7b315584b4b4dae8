"""Each effect that only sensors show: what it does to the volts, and that it leaves the others alone."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from daq_app.config import load_rig
from daq_app.config.rig import Rig, Simulation
from sim_hardware.library import ALL_EFFECTS, SENSOR_EFFECTS, split_effects
from sim_hardware.sensors import layout as la
from sim_hardware.virtual_rig import VirtualRig

RATE = 4000.0
clock_s = 13.0 + np.arange(16_000) / RATE
"""The last second of the hold and the first three of the motion."""

Effects = dict[str, dict[str, float]]


@pytest.fixture(scope="module")
def rig(configs: Path) -> Rig:
    rig = load_rig(configs / "fr1.toml")
    values = rig.simulation.model_dump() | {"offset_scatter": 0.0}
    return rig.model_copy(update={"simulation": Simulation.model_validate(values)})


def wall_with(rig: Rig, effects: Effects | None = None) -> VirtualRig:
    return VirtualRig.from_rig(rig, seed=1, effects=effects or {})


def si(
    rig: Rig, effects: Effects, channel_id: str, times: np.ndarray = clock_s, noisy: bool = False
) -> np.ndarray:
    """What a channel reads, through its certificate."""
    wall = wall_with(rig, effects)
    channel = rig.channel(channel_id)
    volts = wall.chain.volts(wall.scene, (channel.physical_channel,), times, noisy=noisy)[0]
    return np.asarray(channel.polarity * (volts - channel.offset) / channel.sensitivity_v_per_si)


def quantities(rig: Rig, effects: Effects, times: np.ndarray = clock_s) -> dict[str, np.ndarray]:
    wall = wall_with(rig, effects)
    return dict(zip(rig.channel_ids, wall.chain.quantities(wall.scene, times), strict=True))


def test_gain_drift_quadratic_sag_and_polarity(rig: Rig) -> None:
    plain = si(rig, {}, "WP-5")
    np.testing.assert_allclose(si(rig, {"gain@wire": {"error": 0.05}}, "WP-5"), 1.05 * plain, atol=1e-12)
    np.testing.assert_allclose(
        si(rig, {"drift@WP-5": {"rate": 1e-4}}, "WP-5"), plain + 1e-4 * clock_s, atol=1e-12
    )
    np.testing.assert_allclose(
        si(rig, {"wire_cosine@wire": {"kappa": 0.5}}, "WP-5"), plain + 0.5 * plain**2, atol=1e-12
    )
    channel = rig.channel("WP-5")
    length = math.dist(channel.position_m, channel.anchor_m or (0, 0, 0))
    sagging = plain + 0.01 * (length**3 - (length - plain) ** 3)
    np.testing.assert_allclose(si(rig, {"wire_sag@wire": {"kappa": 0.01}}, "WP-5"), sagging, atol=1e-12)
    np.testing.assert_allclose(si(rig, {"polarity@WP-5": {}}, "WP-5"), -plain, atol=1e-12)


def test_lag_and_clock_shift_and_stretch_time(rig: Rig) -> None:
    late = si(rig, {"lag@WP-5": {"tau": 0.02}}, "WP-5")
    np.testing.assert_allclose(late[80:], si(rig, {}, "WP-5")[:-80], atol=1e-12)
    # all sensors go with the sample clock: also those with a response of their own
    sample_clock: Effects = {"clock": {"error": -0.0625}}
    for name in ("WP-5", "LV-A01", "AC-1", "TL-1X"):
        stretched = si(rig, {}, name, clock_s * (1 - 0.0625))
        np.testing.assert_allclose(si(rig, sample_clock, name), stretched, atol=1e-12)


def test_responses_have_their_steady_lag_on_a_ramp(rig: Rig) -> None:
    """Between 0.2 and 0.35 s after release the opening is smooth enough for lag = time constant."""
    window = (clock_s > 14.2) & (clock_s < 14.35)
    plain = si(rig, {}, "LV-A01")
    slope = np.gradient(plain, clock_s)
    for effects in ({"slow_response@lvdt": {"tau": 0.004}}, {"filter_delay@lvdt": {"tau": 0.004}}):
        behind = plain - si(rig, effects, "LV-A01")
        np.testing.assert_allclose(behind[window] / slope[window], 0.004, rtol=0.06)
    ringing = si(rig, {"wire_inertia@wire": {"frequency": 30.0, "zeta": 0.1}}, "WP-5") - si(rig, {}, "WP-5")
    impact = wall_with(rig).truth()["impact_time_s"][0]
    after = (clock_s > impact + 0.005) & (clock_s < impact + 0.105)
    spectrum = np.abs(np.fft.rfft(np.hanning(after.sum()) * np.gradient(ringing[after])))
    assert np.fft.rfftfreq(int(after.sum()), 1 / RATE)[spectrum.argmax()] == pytest.approx(30.0, abs=10.1)


def test_clipping_steps_and_freezing(rig: Rig) -> None:
    plain = si(rig, {}, "WP-5")
    clipped = si(rig, {"saturation@wire": {"limit": 0.08}}, "WP-5")
    np.testing.assert_allclose(clipped, np.clip(plain, -0.08, 0.08), atol=1e-12)
    stepped = si(rig, {"quantisation@wire": {"step": 1e-3}}, "WP-5")
    np.testing.assert_allclose(stepped, 1e-3 * np.rint(plain / 1e-3), atol=1e-9)
    dropped = si(rig, {"dropout@WP-5": {"share": 0.3, "duration": 0.02}}, "WP-5", noisy=True)
    noisy = si(rig, {}, "WP-5", noisy=True)
    frozen = dropped != noisy
    assert np.mean(frozen) == pytest.approx(0.3, abs=0.1)
    starts = np.floor(clock_s[frozen] / 0.02 + 1e-9)
    for start in np.unique(starts):
        assert np.ptp(dropped[frozen][starts == start]) == 0.0
    stuck = si(rig, {"stuck@TL-1X": {"after": 14.5}}, "TL-1X", noisy=True)
    assert np.ptp(stuck[clock_s >= 14.5]) == 0.0
    assert np.array_equal(stuck[clock_s < 14.5], si(rig, {}, "TL-1X", noisy=True)[clock_s < 14.5])


def test_hum_noise_calibration_and_swap(rig: Rig) -> None:
    hum = si(rig, {"hum@lvdt": {"amplitude": 1e-4}}, "LV-A01") - si(rig, {}, "LV-A01")
    spectrum = np.abs(np.fft.rfft(hum)) / hum.size * 2
    peak = spectrum.argmax()
    assert np.fft.rfftfreq(hum.size, 1 / RATE)[peak] == pytest.approx(50.0)
    assert spectrum[peak] == pytest.approx(1e-4, rel=1e-6)
    loud = si(rig, {"noise@WP-5": {"factor": 5.0}}, "WP-5", noisy=True) - si(rig, {}, "WP-5")
    assert loud.std() == pytest.approx(5 * rig.channel("WP-5").noise_si, rel=0.05)
    held = np.array([13.9])
    gains = [
        si(rig, {"calibration": {"tolerance": 0.003}}, c.id, held)[0] / si(rig, {}, c.id, held)[0]
        for c in rig.channels
        if c.family == "wire" or c.id.startswith("LV-A")
    ]
    assert np.std(gains) == pytest.approx(0.003, rel=0.5)
    swapped: Effects = {"swap@wire": {"places": 1}}
    names = [c.id for c in rig.of_family("wire")]
    for here, there in zip(names, [names[-1], *names[:-1]], strict=True):
        np.testing.assert_allclose(si(rig, swapped, here), si(rig, {}, there), atol=1e-12)


def test_structure_effects_show_where_they_should(rig: Rig) -> None:
    release = 14.0
    impact = wall_with(rig).truth()["impact_time_s"][0]
    plain = quantities(rig, {})
    height = rig.specimen.height_m

    bending = quantities(rig, {"flexible_wall": {"gain": 0.01, "frequency": 18.0, "zeta": 0.02}})
    after = (clock_s > impact) & (clock_s < impact + 0.3)
    for channel in rig.of_family("wire"):
        moved = np.abs(bending[channel.id] - plain[channel.id])[after].max()
        shape = (channel.position_m[2] / height) ** 2
        jump = 0.105 * abs(wall_with(rig).truth()["velocity_before_rad_s"][0])
        assert moved == pytest.approx(0.01 * jump * shape, rel=0.12)
    assert np.array_equal(bending["LV-A01"], plain["LV-A01"])

    soft = quantities(rig, {"compliance": {"phi": 2e-3}})
    held = clock_s < release
    theta0 = wall_with(rig).truth()["theta0_rad"]
    alpha = rig.specimen.alpha0_rad
    tilt = (soft["TL-1X"] - plain["TL-1X"])[held]
    np.testing.assert_allclose(tilt, 2e-3 * math.sin(alpha - theta0) / math.sin(alpha), rtol=1e-3)
    assert np.array_equal(soft["LV-A01"], plain["LV-A01"])
    assert (soft["WP-5"] - plain["WP-5"])[held].mean() == pytest.approx(tilt.mean() * 2.8, rel=0.1)

    twisting = quantities(rig, {"twist": {"follow": 0.02}})
    left, right = (c for c in rig.of_family("wire") if c.position_m[2] > 2.5)
    change = {c.id: (twisting[c.id] - plain[c.id])[held].mean() for c in (left, right)}
    for channel in (left, right):
        expected = 0.02 * theta0 * channel.position_m[1] * channel.position_m[2]
        assert abs(change[channel.id]) == pytest.approx(abs(expected), rel=0.05)
    assert np.sign(change[left.id]) == -np.sign(change[right.id])
    assert np.ptp([twisting[c.id][0] for c in rig.of_family("lvdt") if c.position_m[0] < 0]) > 2e-4

    yawing = quantities(rig, {"yaw": {"kick": 0.05}})
    assert np.array_equal(yawing["LV-A01"], plain["LV-A01"])
    assert np.abs(yawing[left.id] - plain[left.id])[after].max() > 1e-5

    sliding = quantities(rig, {"sliding": {"c": 0.02}})
    step = sliding["WP-5"] - plain["WP-5"]
    first = 0.02 * wall_with(rig).truth()["velocity_before_rad_s"][0]
    early = (clock_s > impact) & (clock_s < impact + 0.2)
    assert np.all(step[clock_s < impact] == 0.0)
    np.testing.assert_allclose(np.abs(step[early]), abs(first), rtol=0.02)
    assert np.array_equal(sliding["LV-A01"], plain["LV-A01"])

    stopped = quantities(rig, {"sliding": {"c": 0.02, "square": 0.5}})
    speed = abs(first) / 0.02
    further = abs(first) * (0.5 + 0.5 * speed / 0.2)
    assert speed > 0.25
    np.testing.assert_allclose(np.abs((stopped["WP-5"] - plain["WP-5"])[early]), further, rtol=0.02)

    one_way = quantities(rig, {"sliding_on": {"c": -0.02}})
    truth = wall_with(rig).truth()
    so_far = zip(truth["impact_time_s"], truth["velocity_before_rad_s"], strict=True)
    slid = -0.02 * sum(abs(speed) for at, speed in so_far if at < clock_s[-1])
    for channel in rig.of_family("wire"):
        stays = (one_way[channel.id] - plain[channel.id])[-100:]
        np.testing.assert_allclose(stays, slid, rtol=0.02)
    assert np.array_equal(one_way["LV-A01"], plain["LV-A01"])

    turning = quantities(rig, {"corner_twist": {"c": 2e-3, "alternation": math.pi / 4}})
    truth = wall_with(rig).truth()
    so_far = zip(truth["impact_time_s"], truth["velocity_before_rad_s"], strict=True)
    turned = 2e-3 * math.sqrt(2.0) * sum(speed for at, speed in so_far if speed > 0.0 and at < clock_s[-1])
    for channel in (left, right):
        stays = (turning[channel.id] - plain[channel.id])[-100:]
        np.testing.assert_allclose(stays, -channel.position_m[1] * turned, rtol=0.02)
    assert np.array_equal(turning["LV-A01"], plain["LV-A01"])


@pytest.mark.parametrize("spec", SENSOR_EFFECTS, ids=lambda spec: spec.name)
def test_each_effect_acts_within_its_range_and_only_on_its_target(rig: Rig, spec) -> None:  # type: ignore[no-untyped-def]
    # a limit acts the stronger the lower it is
    strength = spec.strength.low if spec.name == "saturation" else spec.strength.high
    wall, plain = wall_with(rig, {f"{spec.name}@wire": {spec.strength.name: strength}}), wall_with(rig)
    terminals = tuple(c.physical_channel for c in rig.channels)
    times = clock_s[::7]
    changed = np.any(wall.volts(terminals, times) != plain.volts(terminals, times), axis=1)
    for channel, differs in zip(rig.channels, changed, strict=True):
        assert differs == (channel.family == "wire" and spec.name != "stuck"), channel.id
    assert spec.strength.low <= spec.strength.high


@pytest.mark.parametrize(
    "spec", [s for s in SENSOR_EFFECTS if s.name not in ("noise", "saturation", "wire_inertia", "stuck")],
    ids=lambda spec: spec.name,
)  # fmt: skip
def test_each_effect_is_off_at_zero(rig: Rig, spec) -> None:  # type: ignore[no-untyped-def]
    effects = {f"{spec.name}@wire": {spec.strength.name: 0.0}}
    terminals = tuple(c.physical_channel for c in rig.of_family("wire"))
    assert np.array_equal(
        wall_with(rig, effects).volts(terminals, clock_s), wall_with(rig).volts(terminals, clock_s)
    )


def test_the_library_is_whole_and_has_no_doubles() -> None:
    names = [spec.name for spec in ALL_EFFECTS]
    assert len(set(names)) == len(names)
    for spec in ALL_EFFECTS:
        assert spec.summary
        assert spec.equation
        assert spec.reference
        assert set(spec.confusable) - set(names) <= {"p"}, spec.name
    motion, sensors = split_effects({"viscous": {"zeta": 0.01}, "gain@wire": {"error": 0.1}})
    assert motion == {"viscous": {"zeta": 0.01}}
    assert sensors == {"gain@wire": {"error": 0.1}}


def test_layout_columns_do_not_overlap() -> None:
    for prefix, size, widths in (
        ("RW_", la.N_ROW, {"RW_ANCHOR": 3, "RW_RING": 6}),
        ("EV_", la.N_EVENT, {"EV_MODE": 2, "EV_TWIST": 2, "EV_YAW": 2}),
        ("EP_", la.N_EPOCH, {}),
        ("ST_", la.N_STATE, {}),
    ):
        used = [
            column + k
            for name, column in vars(la).items()
            if name.startswith(prefix)
            for k in range(widths.get(name, 1))
        ]
        assert sorted(used) == list(range(size)), prefix

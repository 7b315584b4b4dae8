"""Online and offline against the simulated rig: another dynamics code, 41 sensors, real converters."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.config import Scaling, load_rig, plan_tasks
from daq_app.rocking import AnalysisOptions, LiveAnalyser, TestRecord, analyse_record
from sim_hardware.direct import synthesise_test
from sim_hardware.virtual_rig import VirtualRig

QUICK = AnalysisOptions(bias_runs=0)


def tare_of(rig, readings, samples):
    means = readings[:, :samples].mean(axis=1)
    return {
        channel.id: float(mean - channel.offset) for channel, mean in zip(rig.channels, means, strict=True)
    }


def follow(rig, rate_hz, tare, readings):
    live = LiveAnalyser(rig, rate_hz, tare)
    estimate, events = None, []
    for start in range(0, readings.shape[1], 400):
        result = live.process(start, np.ascontiguousarray(readings[:, start : start + 400]))
        estimate = result.estimate or estimate
        events += result.events
    return estimate, events


@pytest.mark.parametrize(
    ("name", "phi", "r", "tolerance"),
    [
        ("fr1", 0.15, 0.82, 0.01),
        ("fr1", 0.25, 0.95, 0.003),
        ("fr1", 0.35, 0.895, 0.003),
        ("fr1-iepe", 0.40, 0.82, 0.003),
        ("fr2", 0.35, 0.93, 0.003),
        ("fr1-pxie", 0.25, 0.82, 0.003),
    ],
)
def test_r_theta0_and_times_on_every_shipped_rig(configs, name, phi, r, tolerance):
    rig = load_rig(configs / f"{name}.toml")
    plan = plan_tasks(rig)
    test = synthesise_test(rig, plan, phi, seed=5, restitution=r)
    tare = tare_of(rig, test.readings, test.upright_samples)
    truth, alpha = test.truth, rig.specimen.alpha0_rad

    online, events = follow(rig, test.rate_hz, tare, test.readings)
    assert online.eav.r == pytest.approx(r, abs=tolerance)
    assert online.crt.r == pytest.approx(r, abs=tolerance)
    assert online.theta0_rad == pytest.approx(truth["theta0_rad"], abs=0.005 * alpha)
    assert [event.kind for event in events if event.kind != "impact"] == ["hold", "release", "rest"]

    offsets = {c.channel.id: c.time_offset_s for task in plan.tasks for c in task.channels}
    si = Scaling.of(rig.channels, tare).to_si(test.readings)
    offline = analyse_record(TestRecord.from_array(rig, test.rate_hz, si, time_offsets_s=offsets), QUICK)
    assert offline.estimates["eav"].r == pytest.approx(r, abs=tolerance)
    assert offline.estimates["crt"].r == pytest.approx(r, abs=tolerance)
    assert offline.fit.r == pytest.approx(r, abs=tolerance)
    assert offline.theta0_rad == pytest.approx(truth["theta0_rad"], abs=0.005 * alpha)
    assert offline.release_s == pytest.approx(truth["release_s"], abs=1e-3)
    impacts = np.array([cycle.start_s for cycle in offline.half_cycles[1:11]])
    np.testing.assert_allclose(impacts, truth["impact_time_s"][: impacts.size], atol=4e-4)
    shocks = np.array([cycle.accelerometer_s for cycle in offline.half_cycles[1:11]])
    assert np.nanmedian(np.abs(shocks - truth["impact_time_s"][: shocks.size])) < 2e-4
    assert [note.text for note in offline.notes if note.severity == "warning"] == []


def test_a_semi_rigid_wall_shows_where_its_pivot_is(configs):
    rig = load_rig(configs / "fr1.toml")
    rig = rig.model_copy(update={"simulation": rig.simulation.model_copy(update={"semi_rigid": True})})
    plan = plan_tasks(rig)
    test = synthesise_test(rig, plan, 0.25, seed=5, restitution=0.88)
    si = Scaling.of(rig.channels, tare_of(rig, test.readings, test.upright_samples)).to_si(test.readings)
    analysis = analyse_record(TestRecord.from_array(rig, test.rate_hz, si), QUICK)
    assert analysis.joint.inset_left_m == pytest.approx(analysis.joint.inset_theory_m, abs=3e-3)
    assert analysis.joint.inset_right_m == pytest.approx(analysis.joint.inset_theory_m, abs=3e-3)
    assert analysis.fit.alpha_rad == pytest.approx(analysis.theory.semi_rigid_alpha_rad, rel=0.02)
    assert analysis.estimates["eav"].r == pytest.approx(0.88, abs=0.003)


def test_scatter_of_r_is_covered_by_the_interval(configs):
    rig = load_rig(configs / "fr1.toml")
    simulation = rig.simulation.model_copy(update={"restitution_scatter": 0.01})
    rig = rig.model_copy(update={"simulation": simulation})
    plan = plan_tasks(rig)
    inside = 0
    for seed in range(4):
        test = synthesise_test(rig, plan, 0.35, seed=seed, restitution=0.88)
        estimate, _ = follow(
            rig, test.rate_hz, tare_of(rig, test.readings, test.upright_samples), test.readings
        )
        for result in (estimate.eav, estimate.crt):
            low, high = result.interval95()
            inside += low <= 0.88 <= high
            assert result.scatter > 0.003
    assert inside >= 6


def test_hammer_taps_and_letting_down_are_no_test(configs):
    """Commands of the virtual rig: pull, tap the held wall, let it down, tap it upright."""
    rig = load_rig(configs / "fr1.toml")
    wall = VirtualRig(rig, seed=3, scripted=False)
    terminals = tuple(channel.physical_channel for channel in rig.channels)
    script = [
        (3.0, "pull", {"theta0_over_alpha": 0.3, "duration_s": 3.0}),
        (11.0, "hammer", {"intensity_rad_s": 0.02}),
        (13.0, "upright", {"duration_s": 3.0}),
        (18.0, "hammer", {"intensity_rad_s": 0.02}),
    ]
    pieces, time_s = [], 0.0
    for at_s, name, arguments in [*script, (22.0, "status", {})]:
        times = np.arange(round(time_s * 4000), round(at_s * 4000)) / 4000
        pieces.append(wall.volts(terminals, times))
        wall.advance(at_s)
        wall.command(name, arguments)
        time_s = at_s
    readings = np.concatenate(pieces, axis=1)
    _, events = follow(rig, 4000.0, tare_of(rig, readings, 8000), readings)
    assert [event.kind for event in events] == ["hold", "hold_lost"]

"""Faults that show without a fit are found in the runs, named by channel, and taken out of the families."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.features.coefficients import block_coefficients
from daq_app.gap.rocking_model.features.oscillations.rings import ring_columns
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.findings import findings_of
from daq_app.gap.rocking_model.inspection.inspect_runs import found_channels
from daq_app.gap.rocking_model.inspection.wiring import mend
from daq_app.gap.rocking_model.motion.crosstalk import crosstalk
from daq_app.gap.rocking_model.prediction.model import RockingModel
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.run_cache import RunCache
from daq_app.gap.rocking_model.study import model_and_library, prepare
from sim_hardware.dynamics import parameters as par
from sim_hardware.sensors.scene import pivots
from tests.support.gap.conditions import conditions_found
from tests.support.gap.simulated_campaign import simulate as longer_held
from tests.support.simulated_wall import simulate

LEVELS = (0.25, -0.35)
ONE = LEVELS[1:]


def _exchange(run: GapRun, first: str, second: str) -> None:
    """Plug two channels into each other's terminals."""
    at = [next(i for i, sensor in enumerate(run.sensors) if sensor.id == name) for name in (first, second)]
    run.channels[at] = run.channels[at[::-1]]


def _prepared(effects: dict[str, dict[str, float]], levels: tuple[float, ...] = LEVELS) -> list[RockingRun]:
    return prepare(simulate(effects, levels))[0]


def _mark(run: RockingRun, name: str) -> float:
    return next(finding.value for finding in run.findings if finding.key == name)


def _words(runs: list[RockingRun]) -> str:
    return "; ".join(finding.words for finding in findings_of(runs))


def _value(run: RockingRun, family: str, name: str) -> float:
    block = next(b for b in run.blocks if b.family == family)
    return float(block.values[block.names.index(name)])


@pytest.fixture(scope="module")
def healthy() -> list[RockingRun]:
    return _prepared({})


def test_healthy_runs_carry_no_mark_and_no_suspect(healthy: list[RockingRun]) -> None:
    assert conditions_found(healthy) == set()
    assert found_channels(healthy) == {}
    _, library = model_and_library(healthy)
    assert "ambient" not in library, "no vibration of the floor is seen, so none can explain anything"


def test_electronics_are_named_by_channel_with_their_size(healthy: list[RockingRun]) -> None:
    """Four faults on four channels at once; none of them moves the rotation that the fit starts from."""
    runs = _prepared(
        {
            "polarity@LV-B06": {"on": 1.0},
            "hum@WP-2": {"amplitude": 5e-4},
            "dropout@LV-A02": {"share": 0.06, "duration": 0.05},
            "quantisation@LV-A09": {"step": 1e-3},
        }
    )
    assert conditions_found(runs) == {
        "polarity@LV-B06",
        "hum@WP-2",
        "dropout@LV-A02",
        "quantisation@LV-A09",
    }
    for run in runs:
        assert _mark(run, "hum@WP-2") == pytest.approx(5e-4, rel=0.1)
        assert _mark(run, "dropout@LV-A02") == pytest.approx(0.06, abs=0.06)
        assert _mark(run, "quantisation@LV-A09") == pytest.approx(1e-3, rel=0.05)
    # A sound channel never freezes: each run's share counts against how well it is read off that run.
    frozen = next(finding for finding in runs[0].findings if finding.key == "dropout@LV-A02")
    assert frozen.sd < 0.02 * 0.06 + 1e-3
    for run, clean in zip(runs, healthy, strict=True):
        assert run.swings.peak_rad[1] == pytest.approx(clean.swings.peak_rad[1], rel=1e-3)


def test_a_wall_that_dwells_upright_under_a_coarse_converter_is_no_wire_that_freezes() -> None:
    """At rest between two steps of the converter one reading repeats, and then goes on by one step."""
    runs = simulate({"dwell": {"tau": 0.03}}, LEVELS)
    for run in runs:
        for i in run.indices("wire"):
            run.channels[i] = np.round(run.channels[i] / 5.9e-4) * 5.9e-4
    assert not any("dropout" in finding for finding in conditions_found(prepare(runs)[0]))


def test_a_channel_that_freezes_while_the_wall_is_at_rest_is_found() -> None:
    """It goes on by its noise then; a sound reading stays only where its noise is less than a step."""
    runs = simulate({}, LEVELS)
    for run in runs:
        place, samples = run.place("LV-B08"), round(0.24 * run.rate_hz)
        step = 0.8 * run.sensors[place].noise_si
        run.channels[place] = np.round(run.channels[place] / step) * step
        run.channels[place, -2 * samples : -samples] = run.channels[place, -samples]
    assert conditions_found(prepare(runs)[0]) == {"dropout@LV-B08"}


def test_a_channel_that_freezes_in_one_run_of_several_is_named_and_left_out() -> None:
    runs = simulate({}, (0.25, -0.35, 0.3))
    place, start = runs[0].place("LV-B08"), round(4.0 * runs[0].rate_hz)
    readings = runs[0].channels[place]
    readings[start : start + round(0.24 * runs[0].rate_hz)] = readings[start]
    prepared, _ = prepare(runs)
    assert conditions_found(prepared) == {"dropout@LV-B08"}
    assert found_channels(prepared) == {}


def test_a_channel_with_far_more_pick_up_than_its_family_stands_for_itself() -> None:
    runs = _prepared({"hum@wire": {"amplitude": 2e-4}, "hum@WP-2": {"amplitude": 8e-4}})
    assert conditions_found(runs) == {"hum@wire", "hum@WP-2"}
    for run in runs:
        assert _mark(run, "hum@wire") == pytest.approx(2e-4, rel=0.2)
        assert _mark(run, "hum@WP-2") > 5e-4
    alone, all_of_them = (next(f for f in findings_of(runs) if f.name == n) for n in ("hum@WP-2", "hum@wire"))
    assert alone.material
    assert alone.in_noise > 2.0 * all_of_them.in_noise


@pytest.mark.parametrize(("in_noise", "material"), [(1.25, False), (1.7, True)])
def test_pick_up_is_material_from_where_its_rms_is_that_of_the_noise(in_noise: float, material: bool) -> None:
    """The pick-up of an ordinary laboratory has an amplitude of up to one rms of the noise."""
    (noise_m,) = {sensor.noise_si for sensor in simulate({}, LEVELS)[0].sensors if sensor.family == "wire"}
    runs = _prepared({"hum@wire": {"amplitude": in_noise * noise_m}})
    (finding,) = (f for f in findings_of(runs) if f.name == "hum@wire")
    assert finding.material is material
    assert finding.in_noise == pytest.approx(in_noise / math.sqrt(2.0), rel=0.1)


def test_exchanged_plugs_are_put_back() -> None:
    plain = simulate({}, LEVELS)
    for run in plain:
        _exchange(run, "WP-1", "WP-4")
    crossed, _ = prepare(plain)
    assert conditions_found(crossed) == {"swap@wire"}
    assert abs(_value(crossed[0], "wire", "gain")) < 5e-3
    assert "WP-1 and WP-4 exchanged" in _words(crossed)


@pytest.mark.parametrize("pair", [("WP-1", "WP-2"), ("WP-2", "WP-3"), ("WP-3", "WP-4")])
def test_exchanged_neighbours_are_seen(pair: tuple[str, str]) -> None:
    """With a gain of its own each shows nearly what the other should."""
    (run,) = simulate({}, ONE)
    _exchange(run, *pair)
    _, wiring = mend([run])
    assert dict(wiring.exchanged) == dict([pair, pair[::-1]])


def test_a_plug_is_scanned_when_it_was_and_after_the_same_one_wherever_its_sensor_is_put_back() -> None:
    (run,) = simulate({}, ONE)
    place = {sensor.id: i for i, sensor in enumerate(run.sensors)}
    run = replace(run, time_offset_s=1e-6 * np.arange(len(run.sensors)))
    _exchange(run, "WP-1", "WP-4")
    (mended,), wiring = mend([run])
    assert dict(wiring.exchanged) == {"WP-1": "WP-4", "WP-4": "WP-1"}
    before = {name: mended.sensors[mended.before(at)].id for name, at in place.items() if at}
    assert {n: before[n] for n in ("WP-1", "WP-2", "WP-3", "WP-4", "WP-5", "AC-1")} == {
        "WP-1": "WP-3",  # in the fourth plug of the wires
        "WP-2": "WP-4",
        "WP-3": "WP-2",
        "WP-4": "LV-B12",
        "WP-5": "WP-1",
        "AC-1": "WP-5",
    }
    assert mended.before(0) == -1
    assert mended.time_offset_s[place["WP-4"]] == 1e-6 * place["WP-1"]
    of_lvdt = crosstalk(run, [place["WP-1"]])  # which are scanned one after the other
    assert crosstalk(mended, [place["WP-4"]]) == pytest.approx(of_lvdt)


def test_a_small_test_does_not_overrule_the_others_about_plugs() -> None:
    """Slow noise is a twentieth of what one accelerometer shows there, and less in a large test."""
    small, large = simulate({}, (0.12, 0.5))
    for run in (small, large):
        _exchange(run, "AC-1", "AC-2")
    place, at = small.place("AC-2"), np.arange(small.channels.shape[1])
    shown = small.channels[place]
    shown += 0.12 * float(np.std(shown)) * np.sin(2.0 * np.pi * 0.7 / small.rate_hz * at)
    assert mend([small])[1].exchanged == ()
    assert dict(mend([small, large])[1].exchanged) == {"AC-1": "AC-2", "AC-2": "AC-1"}


def test_plugs_that_are_exchanged_in_some_tests_only_are_put_back_in_none() -> None:
    small, large = simulate({}, (0.25, 0.5))
    _exchange(large, "WP-1", "WP-4")
    assert mend([large])[1].exchanged
    assert mend([small, large])[1].exchanged == ()


def test_exchanged_plugs_of_wires_that_are_late_are_put_back() -> None:
    """What is left of a signal that comes 30 ms late is as much as an exchange leaves of it."""
    runs = simulate({"lag@wire": {"tau": 0.03}}, ONE)
    for run in runs:
        _exchange(run, "WP-2", "WP-3")
    crossed, _ = prepare(runs)
    assert "WP-2 and WP-3 exchanged" in _words(crossed)


def test_a_reversed_wire_leaves_the_next_one_its_voltage_as_it_was() -> None:
    """Crosstalk is of volts: turning the readings round again does not turn what the next channel saw."""
    (run,) = simulate({}, ONE)
    place = {sensor.id: i for i, sensor in enumerate(run.sensors)}["WP-4"]
    run.channels[place] *= -1.0
    before = crosstalk(run, [place + 1])
    (mended,), wiring = mend([run])
    assert wiring.reversed_ids == ("WP-4",)
    np.testing.assert_allclose(crosstalk(mended, [place + 1]), before)


def test_accelerometers_along_z_that_are_exchanged_are_put_back() -> None:
    """What impacts leave in these is half of what they show: their places are told between impacts."""
    plain = simulate({}, LEVELS)
    for run in plain:
        _exchange(run, "AC-7", "AC-8")
    crossed, _ = prepare(plain)
    assert conditions_found(crossed) == {"swap@accelerometer"}
    assert "AC-7 and AC-8 exchanged" in _words(crossed)


@pytest.mark.parametrize(
    ("target", "places", "words"),
    [
        ("wire", 1.0, "WP-2 shows WP-1, WP-3 shows WP-2, WP-4 shows WP-3"),
        ("lvdt", 1.0, "LV-A01 and LV-B01 exchanged"),
    ],
)
def test_plugs_that_are_all_moved_on_are_put_back(target: str, places: float, words: str) -> None:
    """Two wires of one height show the same: which of these is which stays open, and needs no answer."""
    key = f"swap@{target}"
    crossed, _ = prepare(simulate({key: {"places": places}}, ONE))
    assert conditions_found(crossed) == {key}
    assert _mark(crossed[0], key) == places
    assert abs(_value(crossed[0], "wire", "gain")) < 5e-3
    assert words in _words(crossed)


def test_a_channel_that_shows_no_sensor_of_its_kind_does_not_hide_exchanged_plugs() -> None:
    runs = simulate({}, ONE)
    place = {sensor.id: i for i, sensor in enumerate(runs[0].sensors)}
    for run in runs:
        _exchange(run, "WP-1", "WP-4")
        run.channels[place["WP-3"]] *= 4.0
    crossed, _ = prepare(runs)
    assert "swap@wire" in conditions_found(crossed)
    assert "WP-1 and WP-4 exchanged" in _words(crossed)


def test_exchanged_accelerometers_are_seen_beside_one_that_is_off() -> None:
    """What the others misfit as they are and as they would be says nothing about the two plugs."""
    runs = simulate({"gain@AC-1": {"error": 0.3}}, ONE)
    for run in runs:
        _exchange(run, "AC-3", "AC-5")
    _, wiring = mend(runs)
    assert wiring.exchanged == (("AC-3", "AC-5"), ("AC-5", "AC-3"))


def test_curvature_of_all_wires_is_no_fault_of_one() -> None:
    """The error grows with the square of the travel, which differs from wire to wire."""
    family = _prepared({"wire_cosine@wire": {"kappa": 0.2}}, ONE)
    assert found_channels(family) == {}
    run = family[0]
    seen = _value(run, "wire", "even harmonic")
    assert seen == pytest.approx(0.2 * run.wire_bend_m, abs=0.01)
    assert found_channels(_prepared({"wire_cosine@WP-4": {"kappa": 0.2}}, ONE)) == {"WP-4": "wire"}


def test_a_drift_of_one_channel_is_no_curvature_of_its_family() -> None:
    """u² of the opened face goes with a drift, so that a curvature of all LVDTs takes up much of it."""
    assert found_channels(_prepared({"drift@LV-B09": {"rate": 3.5e-4}}, ONE)) == {"LV-B09": "lvdt"}


def test_steps_of_all_wires_are_no_fault_of_one() -> None:
    """At rest such a reading shows no step, and in motion the same ones in every half-cycle."""
    runs = _prepared({"quantisation@wire": {"step": 7e-3}})
    assert conditions_found(runs) == {"quantisation@wire"}
    assert found_channels(runs) == {}


def test_an_lvdt_that_steps_out_of_time_with_its_face_is_no_fault() -> None:
    """From a common zero all of a face step together and leave nothing; another gain steps elsewhere."""
    step = 9e-4
    runs = simulate({}, ONE)
    for run in runs:
        for i in run.indices("lvdt"):
            gain = 1.009 if run.sensors[i].id == "LV-B06" else 1.0
            zero = run.channels[i, -600:].mean()
            run.channels[i] = np.round(gain * (run.channels[i] - zero) / step) * step
    prepared = prepare(runs)[0]
    assert conditions_found(prepared) == {"quantisation@lvdt"}
    assert found_channels(prepared) == {}


def test_one_channel_with_another_gain_is_examined_on_its_own() -> None:
    runs = _prepared({"gain@WP-2": {"error": 0.05}})
    assert found_channels(runs) == {"WP-2": "wire"}
    assert _value(runs[0], "WP-2", "gain") == pytest.approx(0.05, abs=0.012)
    model, library = model_and_library(runs)
    assert "gain@WP-2" in library
    assert any(parameter.name == "cal_WP-2_gain" for parameter in model.nuisance)


def test_one_slow_lvdt_is_examined_on_its_own_before_it_shifts_the_times_of_impacts() -> None:
    runs = _prepared({"slow_response@LV-B09": {"tau": 8e-4}})
    assert found_channels(runs) == {"LV-B09": "lvdt"}
    assert _value(runs[0], "LV-B09", "lag") == pytest.approx(8e-4, abs=1.5e-4)


def test_a_very_slow_lvdt_at_the_end_of_its_row_is_told_from_its_neighbours() -> None:
    """It moves what three others are predicted by more than it leaves of its own fault."""
    runs = _prepared({"slow_response@LV-A12": {"tau": 0.03}, "base_tilt": {"beta": 0.0024}})
    assert found_channels(runs) == {"LV-A12": "lvdt"}
    assert conditions_found(runs) == set()


def test_a_wire_that_is_half_a_millisecond_late_is_examined_on_its_own() -> None:
    assert found_channels(_prepared({"lag@WP-5": {"tau": 5e-4}})) == {"WP-5": "wire"}


def test_gravity_is_read_from_a_held_wall_that_still_sways() -> None:
    """What the winch left swings out during the hold; its mean acceleration is no error of a sensor."""
    run = prepare(longer_held({}, 11, levels=(0.15, -0.25)))[0][1]
    block = next(b for b in run.blocks if b.family == "accelerometer")
    place = block.names.index("gain of gravity")
    assert abs(block.values[place]) < 2.0 * np.sqrt(block.covariance[place, place])


def test_pivots_inside_the_edge_are_no_slip_of_the_base() -> None:
    """About another pivot the base moves by Δu (1 − cos θ), which comes and goes with the swings."""
    run = prepare(longer_held({"pivot_shift": {"a": 0.04}}, 11, levels=(0.4,)))[0][0]
    base = next(b for b in run.blocks if b.family == "base")
    values = {p.name: p.mean for p in RockingModel(run.survey).nuisance} | {"zero": 0.0, "omega0": 0.0}
    place = base.names.index("slip per speed")
    seen = float(base.values[place]) - _predicted(run, values, base, place)
    explained = float(base.values[place]) - _predicted(run, values | {"pivot_shift.a": 0.04}, base, place)
    assert abs(explained) < 0.3 * abs(seen)


def _predicted(run: RockingRun, values: dict[str, float], block: Block, place: int) -> float:
    before = list(run.blocks).index(block)
    first = sum(len(b.names) for b in run.blocks[:before])
    return float(block_coefficients(run, values)[first + place])


def test_a_ring_down_is_known_as_well_as_its_damping() -> None:
    """Its size follows from the damping that it was fitted with; both come from all runs, once."""
    effects = {"yaw": {"kick": 0.04, "frequency": 5.0, "zeta": 0.03}}
    runs = _prepared(effects)
    for run in runs:
        block = next(b for b in run.blocks if b.rule == "turning")
        frequency, zeta, _ = block.ring
        assert zeta == pytest.approx(0.03, rel=0.3)
        dying = ring_columns(run.grid, frequency, 1.2 * zeta)
        seen = float(block.projection[0] @ dying[:, 0]), float(block.projection[1] @ dying[:, 1])
        for size, slope in zip(seen, block.fading, strict=False):
            assert size == pytest.approx(1.0 + slope * np.log(1.2), abs=0.03)
            assert size < 0.97


def test_worn_edges_are_where_the_simulator_has_them(healthy: list[RockingRun]) -> None:
    run = replace(healthy[0], impacts_before=120.0, cache=RunCache())
    model = RockingModel(run.survey)
    values = {p.name: p.mean for p in model.nuisance} | {"zero": 0.0, "omega0": 0.0}
    vector = np.zeros(par.N_PARAMETERS)
    alpha = values["alpha"]
    vector[par.ALPHA], vector[par.R0] = alpha, values["half_base"] / np.sin(alpha)
    vector[par.CRUSH_ALPHA], vector[par.IMPACTS_BEFORE] = 0.02, 120.0
    shifted = values["half_base"] - pivots(vector)[0]
    joint = next(b for b in run.blocks if b.family == "joint")
    place = joint.names.index("pivot")
    plain = _predicted(run, values, joint, place)
    worn = _predicted(run, values | {"crushing.loss": 0.02}, joint, place)
    assert plain - worn == pytest.approx(shifted, rel=1e-6)

"""Channels that disagree and that no effect of the library explains are findings, not channels to forget."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.rocking_model.features.run_features import examine
from daq_app.gap.rocking_model.findings import findings_of
from daq_app.gap.rocking_model.inspection.inspect_runs import found_channels
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.study import diagnose_runs, model_and_library, prepare
from tests.support.gap.conditions import conditions_found
from tests.support.gap.play import behind
from tests.support.simulated_wall import simulate

LEVEL = (-0.35,)
_BENDS_1_M = np.random.default_rng(5).uniform(-0.6, 0.6, 24).tolist()


def _scaled(factors: dict[str, float], levels: tuple[float, ...] = LEVEL) -> list[GapRun]:
    runs = simulate({}, levels)
    place = {sensor.id: i for i, sensor in enumerate(runs[0].sensors)}
    for run in runs:
        for name, factor in factors.items():
            run.channels[place[name]] *= factor
    return runs


@pytest.mark.parametrize(
    "factors",
    [
        {"LV-A03": 1.09, "LV-B07": 1.09, "LV-B08": 1.09},
        {"LV-A03": 1.025, "LV-B07": 0.97, "LV-A10": 1.03},
    ],
)
def test_several_channels_of_one_family_that_disagree_are_named_together(factors: dict[str, float]) -> None:
    prepared, _ = prepare(_scaled(factors))
    assert found_channels(prepared) == {}
    assert conditions_found(prepared) == {"disagreement@lvdt"}
    (finding,) = findings_of(prepared)
    assert all(name in finding.words for name in factors)
    wires = next(b for b in prepared[0].blocks if b.family == "wire")
    assert abs(wires.values[wires.names.index("gain")]) < 5e-3
    _, library = model_and_library(prepared)
    assert not any(name.startswith("disagreement") for name in library), "nothing may explain it"


@pytest.mark.parametrize("factors", [{"LV-A03": 1.025, "LV-B07": 0.97}, {"AC-3": 1.06, "AC-5": 1.08}])
def test_two_channels_of_one_family_that_disagree_are_examined_one_by_one(factors: dict[str, float]) -> None:
    prepared, _ = prepare(_scaled(factors))
    assert set(found_channels(prepared)) == set(factors)
    assert findings_of(prepared) == ()
    _, library = model_and_library(prepared)
    for name, factor in factors.items():
        assert f"gain@{name}" in library
        block = next(b for b in prepared[0].blocks if b.family == name)
        assert block.values[block.names.index("gain")] == pytest.approx(factor - 1.0, abs=5e-3)


@pytest.mark.parametrize(
    ("drift_m_s", "found"), [(4e-5, {"LV-A09": "lvdt"}), (0.0, {})], ids=["one drifts", "none does"]
)
def test_an_lvdt_that_drifts_is_found_among_lvdts_that_bend_more_than_most(
    drift_m_s: float, found: dict[str, str]
) -> None:
    """Their readings are bent by up to 0.6 of themselves for each metre, each in its own way."""
    runs = simulate({}, (-0.35, 0.3, -0.25))
    bends_1_m = dict(zip((s.id for s in runs[0].sensors if s.family == "lvdt"), _BENDS_1_M, strict=True))
    for run in runs:
        time_s = np.arange(run.channels.shape[1]) / run.rate_hz
        for name, bend_1_m in bends_1_m.items():
            readings = run.channels[run.place(name)]
            readings += bend_1_m * readings**2
        run.channels[run.place("LV-A09")] += drift_m_s * time_s
    prepared, _ = prepare(runs)
    assert found_channels(prepared) == found
    assert conditions_found(prepared) == set()


@pytest.mark.parametrize(("drift_m_s", "found"), [(2e-5, {"LV-A09": "lvdt"}), (0.0, {})])
def test_a_drift_that_no_run_tells_alone_is_found_over_all_of_them(
    drift_m_s: float, found: dict[str, str]
) -> None:
    """Zeros of all LVDTs walk by 0.01 mm in a second."""
    rng = np.random.default_rng(5)
    runs = simulate({}, (-0.35, 0.3, -0.25, 0.4, 0.35, -0.3))
    for run in runs:
        n = run.channels.shape[1]
        for place in run.indices("lvdt"):
            run.channels[place] += 1e-5 / np.sqrt(run.rate_hz) * np.cumsum(rng.standard_normal(n))
        run.channels[run.place("LV-A09")] += drift_m_s * np.arange(n) / run.rate_hz
    assert found_channels(prepare(runs)[0]) == found


def test_an_lvdt_that_bends_more_than_the_others_hides_no_cause() -> None:
    """By 0.6 mm at a reading of 28 mm, which makes its mean slope 2 % less; the others bend by a tenth."""
    runs, rng = simulate({}, (-0.35, 0.3, -0.25, 0.4)), np.random.default_rng(5)
    lvdts = [sensor.id for sensor in runs[0].sensors if sensor.family == "lvdt"]
    bends_1_m = {name: -0.8 if name == "LV-B03" else rng.uniform(-0.1, 0.1) for name in lvdts}
    for run in runs:
        for name, bend_1_m in bends_1_m.items():
            run.channels[run.place(name)] += bend_1_m * run.channels[run.place(name)] ** 2
    diagnosis = diagnose_runs(runs)
    assert diagnosis.which[0].effects == ("gain@LV-B03",)
    assert diagnosis.decision.verdict != "none_of_these"


@pytest.mark.parametrize("name", ["LV-A06", "LV-A01"])
def test_an_lvdt_into_which_a_wire_leaks_is_examined_on_its_own(name: str) -> None:
    """What leaks goes with the rotation: as much as of a mount that is 10 mm off along the thickness."""
    runs = simulate({}, LEVEL)
    for run in runs:
        wire = run.place("WP-4")
        run.channels[run.place(name)] += 0.01 / run.sensors[wire].position_m[2] * run.channels[wire]
    prepared, _ = prepare(runs)
    assert found_channels(prepared) == {name: "lvdt"}
    assert conditions_found(prepared) == set()
    (block,) = (b for b in prepared[0].blocks if b.family == name)
    assert block.values[block.names.index("what remains")] > 1.0, "it is no gain alone"


def test_a_second_axis_that_follows_the_rotation_is_marked() -> None:
    runs = simulate({}, LEVEL)
    place = {sensor.id: i for i, sensor in enumerate(runs[0].sensors)}
    for run in runs:
        run.channels[place["TL-1Y"]] += 0.08 * run.channels[place["TL-1X"]]
        run.channels[place["TL-2Y"]] += 0.01 * run.channels[place["TL-2X"]]
    prepared, _ = prepare(runs)
    assert conditions_found(prepared) == {"crossed@TL-1Y"}
    (finding,) = findings_of(prepared)
    assert "TL-1Y" in finding.words
    assert finding.size == pytest.approx(0.08, abs=0.01)


def _shaken(amplitude_m_s2: float) -> list[GapRun]:
    """A floor that shakes at 11 Hz for a second, and the rigid wall on it: θ̈ = −(p²/g) cos α a."""
    runs = simulate({}, (-0.35, 0.3))
    for run in runs[:1]:
        t = np.arange(run.channels.shape[1]) / run.rate_hz
        floor = amplitude_m_s2 * np.exp(-(((t - 4.0) / 0.5) ** 2)) * np.sin(2 * np.pi * 11.0 * t)
        follows = run.survey.p_rad_s**2 / 9.81 * np.cos(run.survey.alpha_rad)
        for i in run.indices("accelerometer", "x"):
            run.channels[i] += (1.0 - follows * run.sensors[i].position_m[2]) * floor
    return runs


def test_a_burst_of_shaking_is_found_in_the_run_that_has_it() -> None:
    prepared, _ = prepare(_shaken(0.1))
    findings = [conditions_found([run]) for run in prepared]
    assert findings == [{"shaking@floor"}, set()]
    (finding,) = findings_of(prepared)
    assert "burst of shaking" in finding.words
    assert finding.where == "1 of 2 runs"


def _slipping(fastest_held: dict[float, float]) -> list[GapRun]:
    """A base that friction stops by 0.7 m/s² for as long as the impact was fast.

    Impacts to a side (±1) that are no faster than so many rad/s do not set it off, in every other test those
    that are up to a fifth faster either.
    """
    runs = []
    for k, examined in enumerate(examine(run) for run in simulate({}, (0.25, -0.35, 0.4, 0.3, -0.3))):
        grid, run = examined.features.grid, examined.run
        channels, follows = run.channels.copy(), run.survey.p_rad_s**2 / 9.81 * np.cos(run.survey.alpha_rad)
        t = np.arange(channels.shape[1]) / run.rate_hz - examined.features.swings.release_s
        base = np.zeros(t.size)
        for impact_s, speed in zip(grid.impact_s, grid.approach, strict=True):
            if abs(speed) <= fastest_held[float(np.sign(speed))] * (1.0 + 0.2 * (k % 2)):
                continue
            slips = (t > impact_s) & (t < impact_s + 0.15 * abs(speed))
            base[slips] += 0.7 * np.sign(speed)
        for i in run.indices("accelerometer", "x"):
            channels[i] += (1.0 - follows * run.sensors[i].position_m[2]) * base
        runs.append(replace(run, channels=channels))
    return runs


@pytest.mark.parametrize("fastest_held", [{-1.0: 0.0, 1.0: 0.0}, {-1.0: 0.12, 1.0: 0.21}])
def test_a_base_that_slips_for_a_while_after_impacts_is_no_floor_that_shakes(
    fastest_held: dict[float, float],
) -> None:
    """At slow impacts nothing is seen, or one edge holds impacts at which the other slips."""
    seen = prepare(_slipping(fastest_held))[0]
    assert not any(f.key == "shaking@floor" for run in seen for f in run.findings)


def _knocked(channel: str, size_m: float, *, in_phase: bool) -> list[GapRun]:
    """A channel that rings at 30 Hz after every impact, in one phase or in any."""
    known = [examine(run) for run in simulate({}, (0.25, -0.35, 0.45, -0.3, 0.4, -0.45))]
    rng, runs = np.random.default_rng(5), []
    for examined in known:
        grid = examined.features.grid
        run = replace(examined.run, channels=examined.run.channels.copy())
        runs.append(run)
        place = next(i for i, sensor in enumerate(run.sensors) if sensor.id == channel)
        t = np.arange(run.channels.shape[1]) / run.rate_hz - examined.features.swings.release_s
        for impact_s, jump in zip(grid.impact_s, grid.jumps, strict=True):
            since = np.maximum(t - impact_s, 0.0)
            phase = 0.0 if in_phase else rng.uniform(0.0, 2.0 * np.pi)
            ring = np.exp(-since / 0.1) * np.sin(2.0 * np.pi * 30.0 * since + phase)
            run.channels[place] += size_m * abs(jump) * np.where(t > impact_s, ring, 0.0)
    return runs


@pytest.mark.parametrize(("channel", "size_m"), [("WP-2", 5e-3), ("LV-A04", 1e-3)])
def test_a_channel_that_rings_by_itself_after_impacts_is_named(channel: str, size_m: float) -> None:
    prepared, _ = prepare(_knocked(channel, size_m, in_phase=True))
    assert conditions_found(prepared) == {f"ringing@{channel}"}
    (finding,) = findings_of(prepared)
    assert "ringing at" in finding.words
    assert channel in finding.words


def test_a_cable_that_impacts_whip_in_any_phase_does_not_ring() -> None:
    assert conditions_found(prepare(_knocked("WP-5", 5e-3, in_phase=False))[0]) == set()


def _loose(play_m: float) -> list[GapRun]:
    runs = simulate({}, (0.25, -0.35))
    (place,) = (i for i in runs[0].indices("wire") if runs[0].sensors[i].id == "WP-2")
    for run in runs:
        run.channels[place] = behind(run.channels[place], play_m, run.rate_hz)
    return runs


def test_play_of_a_single_wire_is_named() -> None:
    prepared, _ = prepare(_loose(2e-3))
    assert conditions_found(prepared) == {"play@WP-2"}
    (finding,) = findings_of(prepared)
    assert "play of 2" in finding.words
    assert finding.size == pytest.approx(2e-3, rel=0.15)


def test_the_play_of_a_sound_drum_is_not_named() -> None:
    assert conditions_found(prepare(_loose(3e-4))[0]) == set()


def test_readings_in_steps_have_no_play() -> None:
    runs = simulate({}, (0.25, -0.35))
    for run in runs:
        for place in run.indices("wire"):
            run.channels[place] = np.floor(run.channels[place] / 1.2e-2) * 1.2e-2
    assert not any(key.startswith("play") for key in conditions_found(prepare(runs)[0]))


@pytest.mark.parametrize(("channel", "tau_s"), [("LV-A08", 0.016), ("WP-3", 0.03)])
def test_a_slow_channel_does_not_ring(channel: str, tau_s: float) -> None:
    runs = simulate({f"slow_response@{channel}": {"tau": tau_s}}, (0.25, -0.35, 0.45, -0.3, 0.4, -0.45))
    assert not any(key.startswith("ringing") for key in conditions_found(prepare(runs)[0]))


@pytest.mark.parametrize("effect", ["lag@WP-2", "slow_response@WP-2", "filter_delay@WP-2"])
def test_a_late_wire_has_no_play(effect: str) -> None:
    assert conditions_found(prepare(simulate({effect: {"tau": 0.02}}, (0.25, -0.35)))[0]) == set()


def test_three_instruments_that_are_off_at_once_ask_for_one_cause() -> None:
    names = ("gain@LV-A03", "gain@WP-2", "gain@AC-6")
    runs = simulate({name: {"error": 0.07} for name in names}, (0.25, -0.35, 0.45))
    assert len(found_channels(prepare(runs)[0])) == 3
    result = diagnose_runs(runs, only=names)
    assert result.decision.verdict == "none_of_these"
    assert "3 single instruments are off at once" in result.decision.sentence
    two = diagnose_runs(simulate({n: {"error": 0.07} for n in names[:2]}, (0.25, -0.35, 0.45)), only=names)
    assert two.decision.effects == ("gain@LV-A03", "gain@WP-2")


def test_a_gain_counts_against_how_well_its_family_is_calibrated() -> None:
    """LVDTs that scatter by 0.6 % leave one of them more room than the certificate of 0.3 % says."""
    rng = np.random.default_rng(3)
    names = [f"LV-{face}{n:02d}" for face in "AB" for n in range(1, 13)]
    scatter = {name: 1.0 + 0.006 * rng.standard_normal() for name in names}
    room = []
    for factors in ({"LV-A03": 1.04}, scatter | {"LV-A03": 1.04}):
        (run,) = prepare(_scaled(factors))[0]
        block = next(b for b in run.blocks if b.family == "LV-A03")
        room.append(block.levers[block.names.index("gain")])
    assert room[1] > 1.4 * room[0]


def test_a_corner_counts_against_how_the_others_round_theirs() -> None:
    """LVDTs that are a millisecond apart leave one of them more room than a family that is in step."""
    rng = np.random.default_rng(4)
    names = [f"LV-{face}{n:02d}" for face in "AB" for n in range(1, 13)]
    slow = {
        f"slow_response@{name}": {"tau": float(t)}
        for name, t in zip(names, rng.uniform(1e-3, 3e-3, 24), strict=True)
    }
    room = []
    for effects in ({}, slow):
        (run,) = prepare(simulate(effects | {"gain@LV-A03": {"error": 0.05}}, (-0.35,)))[0]
        block = next(b for b in run.blocks if b.family == "LV-A03")
        room.append(block.levers[block.names.index("rounding")])
    assert room[1] > 1.5 * room[0]


def test_a_turn_is_less_sure_without_one_wire_of_the_pair_that_shows_it() -> None:
    sure = []
    for off in ({}, {"WP-5": 1.06}):
        prepared, _ = prepare(_scaled(off))
        turn = next(b for b in prepared[0].blocks if b.family == "turn")
        sure.append(float(np.sqrt(np.diag(turn.covariance)).min()))
    assert sure[1] > 2.0e-4 > sure[0]


@pytest.mark.parametrize("levels", [(-0.35,), (0.25, -0.35), (0.25, -0.35, 0.45)])
def test_nothing_missing_is_not_said_over_channels_that_disagree(levels: tuple[float, ...]) -> None:
    result = diagnose_runs(
        _scaled({"LV-A03": 1.09, "LV-B07": 1.09, "LV-B08": 1.09}, levels), only=("viscous",)
    )
    assert result.decision.verdict == "none_of_these"
    assert "disagreement (LV-A03, LV-B07, LV-B08)" in result.decision.sentence


def test_one_accelerometer_is_told_from_the_others_to_two_per_cent() -> None:
    """A certificate holds to 0.3 %, and ringing places differ by less than that over half-cycles."""
    runs = simulate({"gain@AC-6": {"error": -0.02}}, (0.25, -0.35))
    assert found_channels(prepare(runs)[0]) == {"AC-6": "accelerometer"}


def test_a_channel_that_rests_at_the_end_of_its_range_has_no_lone_samples() -> None:
    """It shows no noise there, against which every sample of the motion would stand alone."""
    runs = simulate({}, (0.25, -0.35))
    for run in runs:
        place = next(i for i, sensor in enumerate(run.sensors) if sensor.id == "LV-A04")
        walk = np.linspace(0.0, 1.5 * run.sensors[place].range_si[1], run.channels.shape[1])
        run.channels[place] = np.minimum(run.channels[place] + walk, run.sensors[place].range_si[1])
    assert not any("lone samples" in finding.words for finding in findings_of(prepare(runs)[0]))

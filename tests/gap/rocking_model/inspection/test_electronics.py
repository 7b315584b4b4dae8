"""What the mains and converters do to readings, as they are in a laboratory and not in a book."""

from __future__ import annotations

import math

import numpy as np
import pytest

from daq_app.gap.rocking_model.findings import findings_of
from daq_app.gap.rocking_model.inspection.conditions import conditions_of, without_hum
from daq_app.gap.rocking_model.inspection.hum import hum_of
from daq_app.gap.rocking_model.study import prepare
from tests.support.gap.conditions import conditions_found
from tests.support.simulated_wall import simulate

LEVELS = (0.25, -0.35)


@pytest.mark.parametrize("mains_hz", [49.97, 60.03])
def test_mains_beside_their_frequency_that_swell_are_taken_out(mains_hz: float) -> None:
    """Half a turn of phase is lost in 17 s, and the mains swell by a fifth within seconds."""
    amplitude_m = 1e-4
    for run in simulate({}, LEVELS):
        sound = run.channels.copy()
        time_s = np.arange(sound.shape[1]) / run.rate_hz
        wave = (1.0 + 0.2 * np.sin(2.0 * np.pi * time_s / 6.0)) * np.sin(
            2.0 * np.pi * mains_hz * time_s + 1.0
        )
        places = run.indices("lvdt")
        run.channels[places] += amplitude_m * wave
        cleaned = without_hum(run, conditions_of([run])[0]).channels
        left = np.sqrt(np.mean((cleaned[places] - sound[places]) ** 2, axis=1))
        assert np.max(left) < 0.05 * amplitude_m


@pytest.mark.parametrize("target", ["tiltmeter", "TL-2X"])
def test_pick_up_of_tiltmeters_is_found_taken_out_and_counts_over_their_noise(target: str) -> None:
    sound = simulate({}, LEVELS)
    (noise_rad,) = {sensor.noise_si for sensor in sound[0].sensors if sensor.family == "tiltmeter"}
    runs = simulate({f"hum@{target}": {"amplitude": 5.0 * noise_rad}}, LEVELS)
    for run, plain, conditions in zip(runs, sound, conditions_of(runs), strict=True):
        left = without_hum(run, conditions).channels - plain.channels
        assert np.sqrt(np.mean(left**2, axis=1)).max() < 0.3 * noise_rad
    prepared, _ = prepare(runs)
    assert conditions_found(prepared) == {f"hum@{target}"}
    (finding,) = findings_of(prepared)
    assert finding.material
    assert finding.in_noise == pytest.approx(5.0 / math.sqrt(2.0), rel=0.1)
    assert finding.size == pytest.approx(5.0 * noise_rad, rel=0.1)
    assert finding.words.startswith(f"mains hum of {1e3 * finding.size:.3g} mrad in ")


def test_a_tiltmeter_that_freezes_or_has_a_loose_contact_is_named_and_not_used() -> None:
    runs = simulate({"dropout@TL-1X": {"share": 0.06, "duration": 0.05}}, LEVELS)
    chance = np.random.default_rng(4)
    for run in runs:
        place, count = run.place("TL-2X"), run.channels.shape[1]
        alone = chance.choice(count, count // 2000, replace=False)
        run.channels[place, alone] += 100.0 * run.sensors[place].noise_si
    prepared, _ = prepare(runs)
    assert conditions_found(prepared) == {"dropout@TL-1X", "spikes@TL-2X"}
    assert not any(block.family == "tiltmeter" for run in prepared for block in run.blocks)


def test_steps_that_are_coarser_than_those_of_the_converter_are_no_frozen_readings() -> None:
    """Between two of them the converter still goes to and fro by its own."""
    runs = simulate({}, LEVELS)
    rng = np.random.default_rng(3)
    for run in runs:
        place = run.place("WP-3")
        coarse = np.round(run.channels[place] / 1.17e-3) * 1.17e-3
        coarse += 4e-5 * rng.standard_normal(coarse.size)
        run.channels[place] = np.round(coarse / 1.25e-4) * 1.25e-4
    assert conditions_found(prepare(runs)[0]) == {"quantisation@WP-3"}


def test_knocks_that_leave_no_tenth_of_a_second_calm_hide_no_hum() -> None:
    """Every mean over 0.1 s then holds some of a knock: all of the record is used."""
    rate_hz, amplitude = 4000.0, 1.0
    time_s = np.arange(int(16.0 * rate_hz)) / rate_hz
    wave = amplitude * np.sin(2.0 * np.pi * 50.0 * time_s)
    values = wave + 0.05 * np.random.default_rng(8).standard_normal(time_s.size)
    values[:: round(0.075 * rate_hz)] += 8.0
    _, _, found = hum_of(values, rate_hz)
    assert found is not None
    assert np.max(np.abs(found - wave)) < 0.1 * amplitude


@pytest.mark.parametrize("channel", ["LV-A05", "WP-2", "AC-3", "TL-2X"])
def test_a_channel_that_is_far_noisier_than_its_family_is_named(channel: str) -> None:
    prepared, _ = prepare(simulate({f"noise@{channel}": {"factor": 8.0}}, LEVELS))
    assert conditions_found(prepared) == {f"noise@{channel}"}
    (finding,) = findings_of(prepared)
    assert finding.material and finding.explained
    assert finding.size == pytest.approx(8.0, rel=0.15)
    assert (
        finding.words == f"noise of {channel} is {finding.size:.2g} times that of its family in 2 of 2 runs"
    )


def test_channels_that_are_half_as_noisy_again_are_ordinary() -> None:
    (weaker,) = findings_of(prepare(simulate({"noise@LV-A05": {"factor": 2.5}}, LEVELS))[0])
    assert not weaker.material
    assert not findings_of(prepare(simulate({"noise@LV-A05": {"factor": 1.5}}, LEVELS))[0])


def test_accelerometers_that_read_in_steps_are_named_and_left_out() -> None:
    """Between two steps of all of them nothing is left to look for a shaking floor in."""
    runs = simulate({}, LEVELS)
    for run in runs:
        places = run.indices("accelerometer", "x")
        low, high = run.sensors[places[0]].range_si
        step = 0.02 * (high - low)
        run.channels[places] = step * np.round(run.channels[places] / step)
    prepared = prepare(runs)[0]
    assert conditions_found(prepared) == {"quantisation@accelerometer"}
    (found,) = (f for f in findings_of(prepared) if f.name == "quantisation@accelerometer")
    assert found.size == pytest.approx(step) and found.material

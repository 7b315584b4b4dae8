"""The direct path: a whole test's readings, as the modules and the simulated device server give them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from daq_app.config import load_rig, plan_tasks
from daq_app.config.scaling import Scaling
from sim_hardware.daqmx_server.timing.sample_times import SampleTimes
from sim_hardware.daqmx_server.timing.sampling import Input, Sampler
from sim_hardware.direct import converter_of, electrical_per_reading, synthesise_test
from sim_hardware.virtual_rig import VirtualRig


class _NoFault:
    def distort(self, terminals: object, times_s: object, volts: np.ndarray) -> np.ndarray:
        return volts


@pytest.mark.parametrize("name", ["fr1", "fr2", "fr1-iepe", "fr1-pxie"])
def test_readings_are_those_of_the_devices_sampler(configs: Path, name: str) -> None:
    rig = load_rig(configs / f"{name}.toml")
    plan = plan_tasks(rig)
    test = synthesise_test(rig, plan, 0.35, seed=5)
    assert test.readings.shape[0] == 41
    assert test.rate_hz == plan.rate_hz
    wall = VirtualRig.from_rig(rig, seed=5, theta0_over_alpha=0.35)
    start = test.release_sample
    for task in plan.tasks:
        inputs = [
            Input(c.channel.physical_channel, converter_of(rig, c.channel), c.time_offset_s)
            for c in task.channels
        ]
        codes = Sampler(wall, _NoFault(), inputs, SampleTimes(0.0, plan.rate_hz)).codes(start, start + 6000)
        for row, entry, planned in zip(codes, inputs, task.channels, strict=True):
            expected = entry.converter.electrical(row) / electrical_per_reading(planned.channel)
            np.testing.assert_array_equal(test.readings[planned.rig_index, start : start + 6000], expected)


def test_readings_are_quantised_and_within_the_converters_range(configs: Path) -> None:
    rig = load_rig(configs / "fr1.toml")
    test = synthesise_test(rig, plan_tasks(rig), 0.40, seed=2)
    for i, channel in enumerate(rig.channels):
        converter = converter_of(rig, channel)
        codes = (test.readings[i] - converter.middle) / converter.step
        np.testing.assert_allclose(codes, np.rint(codes), atol=1e-6)
        assert converter.low <= test.readings[i].min()
        assert test.readings[i].max() < converter.high


def test_what_the_readings_say_is_the_truth(configs: Path) -> None:
    rig = load_rig(configs / "fr1.toml")
    test = synthesise_test(rig, plan_tasks(rig), 0.25, seed=9, restitution=0.9)
    tilt = next(i for i, c in enumerate(rig.channels) if c.family == "tiltmeter" and c.axis == "x")
    si = Scaling.of([rig.channels[tilt]]).to_si(test.readings[tilt : tilt + 1])[0]
    zero = si[: test.upright_samples].mean()
    held = si[test.release_sample - 8000 : test.release_sample].mean() - zero
    assert held == pytest.approx(test.truth["theta0_rad"], abs=2e-4)
    duration = test.truth["rest_s"] + rig.acquisition.post_rest_s
    assert test.readings.shape[1] == pytest.approx(duration * test.rate_hz, abs=2)
    assert test.truth["restitution"] == 0.9


def test_same_seed_same_readings_other_seed_others(configs: Path) -> None:
    rig = load_rig(configs / "fr1.toml")
    plan = plan_tasks(rig)
    first, again, other = (synthesise_test(rig, plan, 0.15, seed=s).readings for s in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first[:, :1000], other[:, :1000])

"""Continuous and finite acquisition through the real nidaqmx client."""

from __future__ import annotations

import numpy as np
from nidaqmx.constants import AcquisitionType
from nidaqmx.stream_readers import AnalogMultiChannelReader
from server_support import Rig, TestSignals

_PAIRS = "cDAQ1Mod{0}/ai0:7, cDAQ1Mod{0}/ai16:23"


def test_41_channels_continuous(rig: Rig) -> None:
    """Every sample of 41 channels is the signal at its own instant: skewed, quantised, in order."""
    with rig.task("wall") as task:
        for module in (1, 2):
            task.ai_channels.add_ai_voltage_chan(_PAIRS.format(module), min_val=-10, max_val=10)
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod5/ai0:7, cDAQ1Mod5/ai16", min_val=-10, max_val=10)
        task.timing.cfg_samp_clk_timing(4000, sample_mode=AcquisitionType.CONTINUOUS, samps_per_chan=80_000)
        assert task.timing.samp_clk_rate == 4000.0
        task.start()
        reader = AnalogMultiChannelReader(task.in_stream)
        data = np.empty((41, 400))
        blocks = []
        for _ in range(5):
            assert reader.read_many_sample(data, 400, timeout=5.0) == 400
            blocks.append(data.copy())
    got = np.concatenate(blocks, axis=1)
    times = np.arange(2000) / 4000.0
    period = 14e-6  # 4 µs per conversion and 10 µs of padding: 16 channels have room for it
    step = 20 / 2**16
    for row in (0, 3, 20, 40):
        place = row % 16
        terminal = f"x/ai{place if place < 8 else place + 8}"
        expected = TestSignals().volts((terminal,), times + place * period)[0]
        assert np.max(np.abs(got[row] - expected)) <= step / 2 + 1e-12
    assert np.allclose(got / step, np.rint(got / step))

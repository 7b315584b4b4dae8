"""The stated differentiator: exactness, streaming, and its loss at impacts."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daq_app.rocking import VelocityFilter, VelocityStream, free_rocking
from daq_app.rocking.estimators import eav_series, estimate_all
from daq_app.rocking.motion.filtered_peaks import corrected_peaks, filtered_peaks

P, ALPHA, RATE = 2.2, 0.215, 4000.0
FILTER = VelocityFilter(RATE, 25.0)


def test_ramp_and_parabola_are_exact():
    time = np.arange(2000) / RATE
    inner = slice(FILTER.delay_samples, -FILTER.delay_samples)
    np.testing.assert_allclose(FILTER.velocity(3 * time)[inner], 3.0, rtol=1e-10)
    np.testing.assert_allclose(FILTER.velocity(time**2)[inner], 2 * time[inner], atol=1e-10)


def test_gain_is_as_stated():
    low, cut, high = FILTER.gain([0.5, 25.0, 120.0])
    assert low == pytest.approx(1.0, abs=1e-3)
    assert 20 * np.log10(cut) == pytest.approx(-3.01, abs=0.02)
    assert abs(high) < 1e-3
    assert "25 Hz" in FILTER.statement


def test_noise_is_as_stated():
    noise = np.random.default_rng(1).normal(0, 1e-4, 200_000)
    assert FILTER.velocity(noise).std() == pytest.approx(FILTER.noise_rad_s(1e-4), rel=0.03)


@settings(max_examples=25)
@given(st.lists(st.integers(0, 700), min_size=1, max_size=8), st.integers(0, 2**32 - 1))
def test_streaming_equals_offline(sizes, seed):
    signal = np.random.default_rng(seed).normal(size=sum(sizes) + 1)
    stream = VelocityStream(FILTER)
    edges = np.cumsum([0, *sizes, 1])
    parts = [stream.process(signal[a:b]) for a, b in pairwise(edges)]
    streamed = np.concatenate(parts)
    assert streamed.size == max(signal.size - FILTER.delay_samples, 0)
    np.testing.assert_allclose(streamed, FILTER.velocity(signal)[: streamed.size], atol=1e-9)


def test_the_velocity_of_a_part_is_that_of_the_whole_record():
    signal = np.random.default_rng(1).normal(size=1000)
    whole = FILTER.velocity(signal)
    for start, stop in ((0, 50), (400, 401), (950, 1000)):
        np.testing.assert_array_equal(FILTER.velocity_of_part(signal, start, stop), whole[start:stop])


@pytest.mark.parametrize("r", [0.82, 0.9, 0.95])
def test_loss_of_the_peak_is_known_and_corrected(r):
    motion = free_rocking(0.35 * ALPHA, r, P, ALPHA, release_s=1.0)
    time = np.arange(round((motion.impacts_s[-1] + 1) * RATE)) / RATE
    velocity = partial(FILTER.velocity_of_part, motion.at(time)[0])
    peaks = filtered_peaks(time, velocity, motion.impacts_s.tolist())
    large = motion.peaks_rad[:-1] > 0.01 * ALPHA
    true = motion.speeds_before_rad_s[large]
    loss = np.abs(peaks[large]) / true
    predicted = FILTER.peak_ratio(motion.peaks_rad[:-1][large], r, P, ALPHA)
    # A sample may fall on either side of the peak: one sample at p²α is 0.03 % of a small speed.
    np.testing.assert_allclose(predicted, loss, atol=4e-3)
    assert loss[-1] < loss[0] < 0.985  # it is a loss worth knowing, and it grows
    zero = np.zeros(true.size)
    of_peaks = (peaks, corrected_peaks(peaks, FILTER, P, ALPHA))
    raw, corrected = (estimate_all([eav_series(values[large], zero)])[0] for values in of_peaks)
    assert raw.plain_mean < r - 0.001
    assert corrected.r == pytest.approx(r, abs=1e-3)


@pytest.mark.parametrize("cutoff", [0.0, -1.0, 900.0])
def test_a_cutoff_the_rate_cannot_carry_is_refused(cutoff):
    with pytest.raises(ValueError, match="cut-off"):
        VelocityFilter(RATE, cutoff)

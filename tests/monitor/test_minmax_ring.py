"""No sample may vanish between the strips' columns, however the blocks are cut."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from daq_app.monitor.data.minmax_ring import MinMaxRing
from daq_app.monitor.data.motion_trace import MotionTrace


@given(
    n_columns=st.integers(1, 12),
    size=st.integers(1, 9),
    cuts=st.lists(st.tuples(st.integers(0, 15), st.integers(1, 40)), min_size=1, max_size=12),
    start=st.integers(0, 30),
)
@settings(max_examples=200)
def test_each_column_holds_the_extremes_of_exactly_its_samples(n_columns, size, cuts, start):
    rng = np.random.default_rng(5)
    ring = MinMaxRing(3, n_columns, size)
    everything: dict[int, np.ndarray] = {}
    sample = start
    for gap, count in cuts:
        sample += gap
        block = rng.normal(size=(3, count)).astype(np.float32)
        ring.append(sample, block)
        everything.update({sample + k: block[:, k] for k in range(count)})
        sample += count
    low, high = ring.columns()
    newest = (sample - 1) // size
    assert ring.end_sample == (newest + 1) * size
    for place in range(n_columns):
        column = newest - n_columns + 1 + place
        inside = [everything[k] for k in range(column * size, (column + 1) * size) if k in everything]
        if inside:
            np.testing.assert_array_equal(low[:, place], np.min(inside, axis=0))
            np.testing.assert_array_equal(high[:, place], np.max(inside, axis=0))
        else:
            assert np.isnan(low[:, place]).all()
            assert np.isnan(high[:, place]).all()


def test_a_spike_of_one_sample_stays_visible_until_it_leaves_the_strip():
    ring = MinMaxRing(1, 100, 50)
    values = np.zeros((1, 4000), dtype=np.float32)
    values[0, 1234] = 9.81
    for start in range(0, 4000, 400):
        ring.append(start, values[:, start : start + 400])
    assert np.nanmax(ring.columns()[1]) == np.float32(9.81)
    ring.append(4000, np.zeros((1, 2300), dtype=np.float32))
    assert np.nanmax(ring.columns()[1]) == 0


@given(
    capacity=st.integers(1, 30),
    blocks=st.lists(st.integers(0, 50), min_size=1, max_size=20),
    first=st.integers(0, 300),
    width=st.integers(0, 60),
)
def test_the_trace_keeps_the_newest_points_and_any_window_of_them(capacity, blocks, first, width):
    trace = MotionTrace(capacity)
    count = 0
    for size in blocks:
        samples = np.arange(count, count + size, dtype=float)
        trace.append(samples, 2 * samples, 3 * samples)
        count += size
    kept = np.arange(max(0, count - capacity), count, dtype=float)
    assert len(trace) == kept.size
    expected = kept[(kept >= first) & (kept <= first + width)]
    samples, rotation, velocity = trace.window(first, first + width)
    np.testing.assert_array_equal(samples, expected)
    np.testing.assert_array_equal(rotation, 2 * expected)
    np.testing.assert_array_equal(velocity, 3 * expected)


def test_a_restarted_clock_drops_the_old_points():
    trace = MotionTrace(10)
    trace.append(np.array([50.0, 60.0]), np.ones(2), np.ones(2))
    trace.append(np.array([0.0, 10.0]), np.zeros(2), np.zeros(2))
    assert trace.window(0)[0].tolist() == [0.0, 10.0]


@given(
    merge=st.integers(1, 5),
    sizes=st.lists(st.integers(1, 90), min_size=1, max_size=12),
    start=st.integers(0, 99),
)
def test_merged_columns_hold_the_same_extremes_on_a_grid_that_stands_still(merge, sizes, start):
    rng = np.random.default_rng(sum(sizes) + start)
    ring = MinMaxRing(2, 24, 5)
    first = start
    for size in sizes:
        ring.append(first, rng.normal(size=(2, size)).astype(np.float32))
        first += size
    low, high = ring.columns()
    newest = (first - 1) // 5
    group = np.arange(newest - 23, newest + 1) // merge
    wanted = [g for g in np.unique(group) if g * merge >= newest - 23]
    merged_low, merged_high = ring.columns(merge)
    assert merged_low.shape[1] == len(wanted)
    for place, g in enumerate(wanted):
        np.testing.assert_array_equal(merged_low[:, place], np.fmin.reduce(low[:, group == g], axis=1))
        np.testing.assert_array_equal(merged_high[:, place], np.fmax.reduce(high[:, group == g], axis=1))

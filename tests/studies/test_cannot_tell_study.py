"""The study of what cannot be told: its verdicts on a row, and that it adds what the library names."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.gap.rocking_model.library import rocking_library
from studies.cannot_tell.cases import CASES
from studies.cannot_tell.page import outcome
from studies.cannot_tell.wall import Recorded, part_of, simulate


@pytest.mark.parametrize(
    ("first", "second", "verdict"),
    [
        (["a", "b"], ["a"], "resolved"),
        (["a", "b", "c"], ["b", "a"], "smaller"),
        (["a", "b"], ["a", "b"], "open"),
        (["a", "b"], ["b"], "wrong"),
        (["b"], ["b"], "wrong"),
        (["a"], ["a"], "clear"),
        (["b", "c"], ["a"], "resolved"),
    ],
)
def test_a_set_counts_as_resolved_only_if_the_truth_alone_is_left(first, second, verdict):
    sets = [{"set95": [[name] for name in names]} for names in (first, second)]
    assert outcome({"truth": "a", "first": sets[0], "second": sets[1]}) == verdict


@pytest.mark.parametrize("case", [case for case in CASES.values() if case.other], ids=lambda case: case.name)
def test_what_is_added_is_what_the_library_names_for_the_pair(case):
    library = rocking_library()
    group = library.indistinguishable_from(case.name)
    words = [library.separating_measurement(case.name, case.other) or ""]
    words += [group.measure] if group is not None and case.other in group.names else []
    assert any(case.named in text for text in words), words


def test_little_is_a_part_of_the_same_runs():
    everything = Recorded((0.15, -0.15), hold_s=2.0)
    runs = simulate(CASES["viscous"].truth, everything, 3)
    (first,) = part_of(runs, everything, Recorded((0.15,), ("accelerometer",), hold_s=1.5))
    assert [run.level for run in runs] == ["L15", "L15"]
    assert {sensor.family for sensor in first.sensors} == {"lvdt", "wire", "tiltmeter"}
    rows = [row for row, sensor in enumerate(runs[0].sensors) if sensor.family != "accelerometer"]
    np.testing.assert_array_equal(first.channels, runs[0].channels[rows, 2000:])
    np.testing.assert_array_equal(first.time_offset_s, runs[0].time_offset_s[rows])

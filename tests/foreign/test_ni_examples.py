"""NI's examples run unchanged on the simulated server, where a copy of them is at hand."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from studies.ni_examples.__main__ import Outcome, run, table

FOLDER_VARIABLE = "NI_SUITE_FOLDER"


@pytest.mark.heavy
def test_every_example_of_analogue_input_runs_as_it_is() -> None:
    folder = os.environ.get(FOLDER_VARIABLE)
    if folder is None:
        pytest.skip(f"NI's examples are not at hand: give the folder of NI's repository in {FOLDER_VARIABLE}")
    outcomes = run(Path(folder), "analog_in")
    assert len(outcomes) >= 18
    assert [outcome for outcome in outcomes if not outcome.passed] == []


def test_the_table_leaves_out_what_waits_for_a_real_signal_and_says_so() -> None:
    shown = table([Outcome("counter_in/cnt_dig_event.py", False, ""), Outcome("analog_in/a.py", True, "1.0")])
    assert "1 of 1 examples ran" in shown
    assert "- needs a real signal: counter_in/cnt_dig_event.py counts edges at PFI8" in shown

"""NI's own tests of its Python client pass on the simulated server, where a copy of them is at hand."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from studies.ni_suite.__main__ import is_analog_input, run

FOLDER_VARIABLE = "NI_SUITE_FOLDER"


@pytest.mark.heavy
def test_nis_own_suite_passes_on_the_simulated_server() -> None:
    folder = os.environ.get(FOLDER_VARIABLE)
    if folder is None:
        pytest.skip(f"NI's suite is not at hand: give the folder of NI's repository in {FOLDER_VARIABLE}")
    pytest.importorskip("pytest_mock", reason="NI's suite needs pytest-mock")
    rows = run(Path(folder), ["tests/component", "tests/legacy"])
    passed = [row for row in rows if row["outcome"] == "passed"]
    assert len(passed) >= 0.8 * len(rows)


def test_tests_of_analogue_input_are_told_by_file_and_name() -> None:
    assert is_analog_input("tests/component/task/test_task_read_ai.py::test___x___y[grpc_init_kwargs]")
    assert not is_analog_input("tests/component/test_watchdog.py::test___watchdog_task___x")

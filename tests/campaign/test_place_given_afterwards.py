"""A release that nobody armed is given its place in the campaign afterwards."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from daq_app.campaign.recorded import read_recorded
from daq_app.campaign.result.result import NoResult, level_of
from daq_app.campaign.status import TestVerdict
from daq_app.campaign.verdicts import give_verdict
from daq_app.cli.app import build_app
from daq_app.runfile import JournalWriter, RunHeader, finalise


def run_file(folder: Path, *, kept: bool) -> Path:
    header = RunHeader(
        run_id="unarmed_1",
        test="unarmed" if kept else "FR1-L1-1",
        channel_ids=("A",),
        reading_units=("V",),
        rate_hz=100.0,
        kept={"ring": "r"} if kept else None,
    )
    journal = folder / "unarmed_1.journal"
    with JournalWriter(journal, header) as writer:
        writer.append_block(0, np.zeros((1, 100)))
        writer.append_event("released", 10, "released")
        writer.append_event("at_rest", 90, "rest")
        writer.append_event("end", 100, "done", {"outcome": "complete"})
    return finalise(journal, folder / "unarmed_1.h5", None, keep_journal=False)


def test_it_counts_under_the_name_it_is_given_and_keeps_it_under_a_verdict(tmp_path: Path) -> None:
    run = run_file(tmp_path, kept=True)
    assert read_recorded(tmp_path) == []
    done = CliRunner().invoke(build_app(), ["campaign", "assign", str(run), "FR1-L3-2"])
    assert done.exit_code == 0, done.output
    (test,) = read_recorded(tmp_path)
    assert (str(test.name), test.verdict) == ("FR1-L3-2", TestVerdict.UNCHECKED)
    give_verdict(tmp_path, "unarmed_1", "bad", "caught")
    (test,) = read_recorded(tmp_path)
    assert (str(test.name), test.verdict) == ("FR1-L3-2", TestVerdict.BAD)


def test_an_armed_test_keeps_the_name_it_was_armed_for(tmp_path: Path) -> None:
    run = run_file(tmp_path, kept=False)
    done = CliRunner().invoke(build_app(), ["campaign", "assign", str(run), "FR1-L3-2"])
    assert done.exit_code != 0
    assert str(read_recorded(tmp_path)[0].name) == "FR1-L1-1"


def test_who_looks_for_its_result_is_told_to_give_it_a_place(tmp_path: Path) -> None:
    run = run_file(tmp_path, kept=True)
    with pytest.raises(NoResult, match=f"campaign assign {re.escape(str(run))} NAME"):
        level_of(run)

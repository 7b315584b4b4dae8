"""A new test in a folder of damaged and hostile files: recorded, saved, analysed, and the rest told."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq_app.acquisition.messages.published import State
from daq_app.campaign.recorded import read_recorded
from daq_app.campaign.result.result import make_result
from daq_app.runfile import JournalWriter, RunHeader, finalise, open_run, recover, verify
from tests.support.files.hostile_folder import take_seal_off, write_hostile_files

HEALTHY = ("FR1-L1-1", "FR1-L1-2", "FR1-L1-3")


def small_journal(path: Path, name: str) -> Path:
    header = RunHeader(run_id=name, test=name, channel_ids=("A",), reading_units=("V",), rate_hz=100.0)
    with JournalWriter(path, header) as writer:
        writer.append_block(0, np.arange(100.0)[None, :])
    return path


@pytest.fixture
def folder(tmp_path: Path) -> tuple[Path, set[str]]:
    """Three healthy journals between twenty files that mean no good; the folder, and their names."""
    runs = tmp_path / "runs"
    runs.mkdir()
    journal = small_journal(tmp_path / "sound.journal", "sound")
    sealed = finalise(journal, tmp_path / "sound.h5")
    old = take_seal_off(Path(shutil.copy(sealed, tmp_path / "old.h5")))
    for name in HEALTHY:
        small_journal(runs / f"{name}.journal", name)
    return runs, write_hostile_files(runs, sealed, old, journal)


@pytest.mark.heavy
def test_a_test_is_recorded_saved_and_analysed_among_them(
    live: Callable[..., Any], wall_test: Any, folder: tuple[Path, set[str]]
) -> None:
    runs, bad = folder
    assert len(bad) == 20
    lab = live(runs)
    lab.zero_and_arm("FR1-L4-1")
    lab.driver.let(wall_test.n_samples)
    saved = lab.wait_for_state(State.SAVED, State.FAILED)
    assert saved.state is State.SAVED, saved.text
    run = Path(saved.run_path)
    assert verify(run).ok
    assert make_result(run).test.methods["CRT"].r == pytest.approx(0.7, abs=0.01)

    told = {found.journal.name: found for found in recover(runs)}
    for name in HEALTHY:
        with open_run(runs / f"{name}.h5") as recovered:
            assert np.array_equal(recovered.readings()[0], np.arange(100.0))
    links = {path.name for path in runs.iterdir() if path.is_symlink()}
    assert bad - links <= set(told), "what was left alone is listed"
    assert all(told[name].text for name in bad - links), "each with its reason"
    assert (runs / "FR1-L3-91.h5").is_symlink(), "nothing was written through a link or in its place"
    assert "FR1-L4-1" in {str(test.name) for test in read_recorded(runs)}

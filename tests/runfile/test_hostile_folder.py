"""In a folder of damaged and hostile files what is healthy is recovered, the rest is listed with a reason."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from daq_app.campaign.recorded import read_recorded
from daq_app.campaign.status import TestVerdict
from daq_app.runfile import finalise, open_run, recover, verify
from daq_app.runfile.hdf5 import probe
from tests.support.files.hostile_folder import write_hostile_files


@pytest.fixture
def folder(tmp_path: Path, make_journal, without_seal, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Three healthy journals, one of them beside a damaged run, and twenty files that mean no good."""
    monkeypatch.setattr(probe, "CPU_LIMIT_S", 1.0)
    probe._prober.cache_clear()
    runs = tmp_path / "runs"
    runs.mkdir()
    for number in (1, 2, 3):
        make_journal(runs / f"FR1-L1-{number}.journal", n_blocks=3, seed=number)
    make_journal(tmp_path / "sound.journal", n_blocks=6)
    sealed = finalise(tmp_path / "sound.journal", tmp_path / "sound.h5")
    old = without_seal(Path(shutil.copy(sealed, tmp_path / "old.h5")))
    write_hostile_files(runs, sealed, old, tmp_path / "sound.journal")
    shutil.copy(runs / "FR1-L3-1.h5", runs / "FR1-L1-3.h5")
    return runs


@pytest.mark.heavy
def test_recovery_verification_and_campaign_go_on_past_every_file(folder: Path) -> None:
    bad = {
        path.name for path in folder.iterdir() if not (path.name.startswith("FR1-L1") or path.is_symlink())
    }
    assert len(bad) >= 19
    told = {found.journal.name: found for found in recover(folder, thorough=True)}
    for number in (1, 2, 3):
        found = told[f"FR1-L1-{number}.journal"]
        assert found.outcome == "recovered" and found.run is not None
        with open_run(found.run) as run:
            assert np.isfinite(run.readings()).all()
    assert "set aside" in told["FR1-L1-3.journal"].text
    assert bad <= set(told), "what was left alone is listed"
    assert all(told[name].outcome in ("failed", "left alone", "empty") and told[name].text for name in bad)

    report = verify(folder)
    verdicts = {child.path.name: child.ok for child in report.children}
    assert all(verdicts[f"FR1-L1-{number}.h5"] for number in (1, 2, 3))
    assert not any(ok for name, ok in verdicts.items() if name.startswith("FR1-L3"))
    assert all(child.ok or child.problems for child in report.children)
    lost = {str(test.name) for test in read_recorded(folder) if test.verdict is TestVerdict.LOST}
    assert {"FR1-L3-1", "FR1-L3-2", "FR1-L3-90"} <= lost

"""Which runs a folder holds, also while another program is at work in it."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from daq_app.runfile.folder import find_journals, find_runs


def test_runs_below_are_found_in_order_and_hidden_folders_are_not_looked_into(tmp_path: Path) -> None:
    wanted = [tmp_path / "a.h5", tmp_path / "b" / "c" / "d.h5"]
    for path in (*wanted, tmp_path / ".ring" / "e.h5", tmp_path / "b" / "f.journal"):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    assert find_runs(tmp_path) == wanted
    assert find_journals(tmp_path) == [tmp_path / "b" / "f.journal"]


def test_a_ring_that_goes_while_somebody_looks_hides_no_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.h5").touch()
    ring = tmp_path / ".ring" / "session"
    ring.mkdir(parents=True)
    real = os.scandir

    def scandir(path: str | os.PathLike[str]) -> object:
        if Path(path) != tmp_path:  # the folder itself has been listed: the recorder removes its ring now
            shutil.rmtree(tmp_path / ".ring", ignore_errors=True)
        return real(path)

    monkeypatch.setattr(os, "scandir", scandir)
    assert find_runs(tmp_path) == [tmp_path / "a.h5"]

"""The file by which viewers find the acquisition, while one of them is reading it, as Windows refuses it."""

from __future__ import annotations

import stat
import sys
from pathlib import Path

import pytest

from daq_app.acquisition.viewers.session_file import SessionFile, read_session_file, write_session_file
from daq_app.runfile import RunFileError, durable

OLD = SessionFile(address="tcp://127.0.0.1:1", token="old", pid=1)
NEW = SessionFile(address="tcp://127.0.0.1:2", token="new", pid=2, rig="FR1")


@pytest.mark.skipif(sys.platform == "win32", reason="no such permissions")
def test_nobody_else_reads_it(tmp_path: Path) -> None:
    path = write_session_file(tmp_path, NEW)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert read_session_file(tmp_path) == NEW


@pytest.mark.parametrize("attempts", [3, float("inf")])
def test_one_that_is_being_read_is_replaced_once_it_is_let_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, attempts: float
) -> None:
    write_session_file(tmp_path, OLD)
    left, replace = [attempts], Path.replace

    def refused(self: Path, target: Path) -> Path:
        if left[0] > 0:
            left[0] -= 1
            raise PermissionError(13, "Access is denied", str(target))
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", refused)
    monkeypatch.setattr(durable.time, "sleep", lambda seconds: None)
    if attempts == 3:
        write_session_file(tmp_path, NEW)
        assert read_session_file(tmp_path) == NEW
    else:
        with pytest.raises(RunFileError, match="close the program that has it open"):
            write_session_file(tmp_path, NEW)
        assert read_session_file(tmp_path) == OLD
    assert [path.name for path in tmp_path.iterdir()] == [".acquisition.json"]

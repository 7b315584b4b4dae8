"""Giving a file its name while another program holds the one that bears it, as Windows refuses it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from daq_app.runfile import durable
from daq_app.runfile.durable import remove, write_whole

_REPLACE = Path.replace


class HeldFile:
    """`Path.replace` as it is on Windows onto a file that another program has open."""

    def __init__(self, path: Path, attempts: float) -> None:
        self.path, self.left = path, attempts

    def replace(self, source: Path, target: Path) -> Path:
        if target == self.path and self.left > 0:
            self.left -= 1
            raise PermissionError(13, "Access is denied", str(source))
        return _REPLACE(source, target)


@pytest.fixture
def waits(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[float]]:
    waited: list[float] = []
    monkeypatch.setattr(durable.time, "sleep", waited.append)
    yield waited


def _hold(path: Path, attempts: float, monkeypatch: pytest.MonkeyPatch) -> None:
    path.write_text("old", encoding="utf-8")
    held = HeldFile(path, attempts)
    monkeypatch.setattr(Path, "replace", lambda source, target: held.replace(source, Path(target)))


def test_a_file_that_is_let_go_soon_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, waits: list[float]
) -> None:
    page = tmp_path / "report.pdf"
    _hold(page, 3, monkeypatch)
    assert write_whole(page, "new") == page
    assert page.read_text(encoding="utf-8") == "new"
    assert len(waits) == 3


def test_a_page_that_stays_open_gets_a_second_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, waits: list[float]
) -> None:
    page = tmp_path / "report.pdf"
    _hold(page, float("inf"), monkeypatch)
    (tmp_path / "report (2).pdf").write_text("of yesterday", encoding="utf-8")
    assert write_whole(page, "new", other_name=True) == tmp_path / "report (3).pdf"
    assert page.read_text(encoding="utf-8") == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["report (2).pdf", "report (3).pdf", "report.pdf"]


def test_a_file_that_must_have_its_name_is_refused_and_stays_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, waits: list[float]
) -> None:
    ledger = tmp_path / "verdicts.json"
    _hold(ledger, float("inf"), monkeypatch)
    with pytest.raises(PermissionError):
        write_whole(ledger, "new")
    assert ledger.read_text(encoding="utf-8") == "old"
    assert list(tmp_path.iterdir()) == [ledger]
    assert sum(waits) < 2.0


@pytest.mark.parametrize(("attempts", "gone"), [(0, True), (4, True), (float("inf"), False)])
def test_a_file_that_another_program_reads_is_removed_once_it_is_let_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, waits: list[float], attempts: float, gone: bool
) -> None:
    path, left, unlink = tmp_path / "a.part", [attempts], Path.unlink
    path.write_text("old", encoding="utf-8")

    def refused(self: Path, *, missing_ok: bool = False) -> None:
        if left[0] > 0:
            left[0] -= 1
            raise PermissionError(13, "Access is denied", str(self))
        unlink(self, missing_ok=missing_ok)

    monkeypatch.setattr(Path, "unlink", lambda self, missing_ok=False: refused(self, missing_ok=missing_ok))
    assert remove(path) is gone
    assert path.exists() is not gone
    assert len(waits) == min(attempts, 6)

"""In a folder of damaged and hostile files what is healthy is recovered, the rest is listed with a reason."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from daq_app.campaign.recorded import read_recorded
from daq_app.campaign.status import TestVerdict
from daq_app.runfile import finalise, open_run, recover, verify
from daq_app.runfile.hdf5 import probe
from daq_app.runfile.seal.format import MAGIC


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
    for number, content in enumerate(_bad_runs(sealed.read_bytes(), old.read_bytes()), start=1):
        (runs / f"FR1-L3-{number}.h5").write_bytes(content)
    journal = (tmp_path / "sound.journal").read_bytes()
    for number, content in enumerate(_bad_journals(journal), start=1):
        (runs / f"FR1-L2-{number}.journal").write_bytes(content)
    shutil.copy(runs / "FR1-L3-1.h5", runs / "FR1-L1-3.h5")
    _forge(old, runs / "FR1-L3-90.h5")
    return runs


def _bad_runs(sealed: bytes, old: bytes) -> list[bytes]:
    rng = random.Random(3)
    heap = old.find(b"GCOL")
    endless = bytearray(old)
    endless[heap + 16 : heap + 4096] = bytes(4080)
    flipped = bytearray(sealed)
    flipped[len(sealed) // 2] ^= 1
    return [
        bytes(endless),
        old[: len(old) // 2],
        sealed[: len(sealed) // 2],
        bytes(flipped),
        sealed.replace(MAGIC, bytes(16)),
        b"",
        b"\x89HDF\r\n\x1a\n" + rng.randbytes(50_000),
        rng.randbytes(50_000),
        b"no run at all",
        bytes(100_000),
        old[:100] + bytes(64) + old[164:],
        old[:-5000],
        sealed[1000:],
    ]


def _bad_journals(journal: bytes) -> list[bytes]:
    rng = random.Random(4)
    return [b"", rng.randbytes(20_000), journal[:30], bytes(30_000), b"[" * 30_000]


def _forge(old: Path, forged: Path) -> None:
    """A run whose texts lie in another file."""
    shutil.copy(old, forged)
    with h5py.File(forged, "r+") as file:
        del file["header_json"]
        file["header_json"] = h5py.ExternalLink("/etc/passwd", "/header_json")


@pytest.mark.heavy
def test_recovery_verification_and_campaign_go_on_past_every_file(folder: Path) -> None:
    bad = {path.name for path in folder.iterdir() if not path.name.startswith("FR1-L1")}
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

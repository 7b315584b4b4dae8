"""A folder of runs in which twenty files mean no good: damaged, forged, foreign, empty."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

import h5py

from daq_app.runfile.seal.format import MAGIC


def write_hostile_files(runs: Path, sealed: Path, old: Path, journal: Path) -> set[str]:
    """Write twenty bad files, made from a sound run, one without seal and a journal; their names."""
    bad = []
    for number, content in enumerate(_bad_runs(sealed.read_bytes(), old.read_bytes()), start=1):
        bad.append(runs / f"FR1-L3-{number}.h5")
        bad[-1].write_bytes(content)
    for number, content in enumerate(_bad_journals(journal.read_bytes()), start=1):
        bad.append(runs / f"FR1-L2-{number}.journal")
        bad[-1].write_bytes(content)
    bad.append(runs / "FR1-L3-90.h5")
    _forge(old, bad[-1])
    bad.append(runs / "FR1-L3-91.h5")
    bad[-1].symlink_to(journal)
    return {path.name for path in bad}


def take_seal_off(path: Path) -> Path:
    """Make a run one of format version 1, which differs by its seal only."""
    with h5py.File(path, "r+") as file:
        del file["integrity"]
        file.attrs["format_version"] = 1
    path.write_bytes(path.read_bytes().replace(MAGIC, bytes(len(MAGIC))))
    return path


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

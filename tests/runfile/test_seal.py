"""Every byte of a run file stands under its seal; damage, edits and files without a seal are told apart."""

from __future__ import annotations

import errno
import os
import random
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from daq_app.runfile import DerivedData, DerivedSignal, RunFileError, finalise, open_run, verify
from daq_app.runfile.hdf5.probe import Prober
from daq_app.runfile.seal.format import MAGIC
from daq_app.runfile.seal.proven_file import seal_of
from daq_app.runfile.seal.signing import own_public_key


@pytest.fixture
def run(tmp_path: Path, make_journal) -> Path:
    make_journal(tmp_path / "run.journal", n_blocks=6, gap_after=3)
    derived = DerivedData(1000, {"rotation": DerivedSignal(np.arange(7.0), "rad", "θ")}, 2, {"r": 0.9})
    return finalise(tmp_path / "run.journal", tmp_path / "run.h5", derived, keep_journal=False)


def test_a_new_run_is_sealed_and_signed_by_this_machine(run: Path) -> None:
    report = verify(run)
    assert report.ok and report.proven == "every byte"
    assert report.notes == ("150 samples per channel are missing, in 1 gaps",)
    seal = seal_of(run)
    assert seal is not None and seal.file_bytes == run.stat().st_size and len(seal.signature) == 64


def test_a_file_system_without_hard_links_keeps_one_key(
    tmp_path: Path, make_journal, monkeypatch: pytest.MonkeyPatch
) -> None:
    """exFAT and many shares have none: the key is made once and stays, and no part of it lies beside."""

    def refused(*_: object, **__: object) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(os, "link", refused)
    monkeypatch.setattr("platformdirs.user_config_path", lambda *_, **__: tmp_path / "keys")
    keys = []
    for name in ("one", "two"):
        make_journal(tmp_path / f"{name}.journal", n_blocks=2)
        run = finalise(tmp_path / f"{name}.journal", tmp_path / f"{name}.h5", None, keep_journal=False)
        assert verify(run).ok
        seal = seal_of(run)
        assert seal is not None
        keys.append(seal.public_key)
    assert keys[0] == keys[1] == own_public_key() != bytes(32)
    assert [path.name for path in (tmp_path / "keys").iterdir()] == ["seal.key"]


def test_a_changed_bit_anywhere_is_found(run: Path) -> None:
    sound = run.read_bytes()
    rng = random.Random(4)
    for _ in range(150):
        at = rng.randrange(len(sound))
        content = bytearray(sound)
        content[at] ^= 1 << rng.randrange(8)
        run.write_bytes(content)
        assert not verify(run).ok, f"byte {at}"


def _fields(group: h5py.Group) -> Iterator[str]:
    """Every attribute and dataset, as PATH or PATH@ATTRIBUTE."""
    yield from (f"{group.name}@{name}" for name in group.attrs)
    for item in group.values():
        if isinstance(item, h5py.Group):
            yield from _fields(item)
        else:
            yield item.name
            yield from (f"{item.name}@{name}" for name in item.attrs)


def _other(value: Any) -> Any:
    """The value with one bit of it changed."""
    if isinstance(value, str | bytes):
        text = value if isinstance(value, str) else value.decode()
        return chr(ord(text[0]) ^ 1) + text[1:] if text else "\x01"
    array = np.atleast_1d(np.array(value))
    array.view(np.uint8).flat[0] ^= 1
    return array.reshape(np.shape(value))


def test_one_bit_of_every_field_is_found(run: Path) -> None:
    """Each attribute and the first value of each dataset, one after the other, written by HDF5 itself."""
    sound = run.read_bytes()
    with h5py.File(run) as file:
        fields = list(_fields(file))
    changed = 0
    for field in fields:
        run.write_bytes(sound)
        path, _, attribute = field.partition("@")
        with h5py.File(run, "r+") as file:
            item = file[path]
            if attribute:
                value = item.attrs[attribute]
                if np.asarray(value).dtype.kind in "OV" and not isinstance(value, str):
                    continue  # references between axes and their scales: part of the format, not of the run
                item.attrs[attribute] = _other(value)
            elif item.size:
                first = () if item.shape == () else 0
                item[first] = _other(item[first])
        changed += run.read_bytes() != sound
        assert not verify(run).ok, field
    assert changed > 150


def test_what_is_proven_can_still_be_read_from_a_damaged_run(tmp_path: Path, make_journal) -> None:
    readings = make_journal(tmp_path / "long.journal", n_blocks=150)
    path = finalise(tmp_path / "long.journal", tmp_path / "long.h5")
    with h5py.File(path) as file:
        hurt = file["raw/TL-1X"].id.get_chunk_info(3).byte_offset
    content = bytearray(path.read_bytes())
    content[hurt + 100 : hurt + 4000] = bytes(3900)
    path.write_bytes(content)
    with open_run(path) as opened:
        np.testing.assert_array_equal(opened.readings(["LV-A01"], 0, 5000), readings[:1, :5000])
        with pytest.raises(RunFileError, match="TL-1X"):
            opened.readings(["TL-1X"])
    (problem,) = verify(path).problems
    assert "are not the ones that were saved" in problem


def test_an_edit_under_a_new_seal_is_told_by_its_signature(run: Path, with_new_seal) -> None:
    sound = seal_of(run)
    assert sound is not None

    def edit() -> None:
        with h5py.File(run, "r+") as file:
            file.attrs["test"] = "FR1-L1-2"

    edit()
    with_new_seal(run, lambda root: (sound.public_key, sound.signature))
    assert verify(run).problems == (
        "the signature of its seal is wrong: somebody changed the file and made a new seal",
    )
    with_new_seal(run)
    assert any("not signed" in note for note in verify(run).notes)
    stranger = Ed25519PrivateKey.generate()
    with_new_seal(run, lambda root: (stranger.public_key().public_bytes_raw(), stranger.sign(root)))
    report = verify(run)
    assert report.ok and any(stranger.public_key().public_bytes_raw().hex() in note for note in report.notes)


@pytest.mark.parametrize("place", [20, 40, 60, 400])
def test_a_damaged_seal_is_told(run: Path, place: int) -> None:
    content = bytearray(run.read_bytes())
    content[content.find(MAGIC) + place] ^= 8
    run.write_bytes(content)
    report = verify(run)
    assert not report.ok and "seal" in report.problems[0]


def test_a_run_whose_seal_was_taken_away_is_not_taken_for_an_old_one(run: Path) -> None:
    content = run.read_bytes()
    run.write_bytes(content.replace(MAGIC, bytes(16)))
    with pytest.raises(RunFileError, match="its seal is missing"):
        open_run(run)


def test_a_run_of_version_1_is_read_and_what_is_proven_of_it_is_said(run: Path, without_seal) -> None:
    without_seal(run)
    report = verify(run)
    assert report.ok and report.proven == "readings"
    assert any("it has no seal" in note for note in report.notes)


def _change_test(file: h5py.File) -> None:
    file.attrs["test"] = "FR1-L1-2"


def _change_alpha(file: h5py.File) -> None:
    text = file["rig_toml"].asstr()[()]
    assert "alpha0_rad = 0.2" in text
    del file["rig_toml"]
    file["rig_toml"] = text.replace("alpha0_rad = 0.2", "alpha0_rad = 0.3")


def _move_event(file: h5py.File) -> None:
    file["events/sample"][0] += 4096


def _link_rig(file: h5py.File) -> None:
    del file["rig_toml"]
    file["rig_toml"] = h5py.ExternalLink("elsewhere.h5", "/rig_toml")


def _move_time(file: h5py.File) -> None:
    file["raw/time"][5] += 1.0


def _change_gain(file: h5py.File) -> None:
    file["raw/WP-1"].attrs["si_per_reading"] *= 2


def _change_certificate(file: h5py.File) -> None:
    file["channels/certificate"][1] = "another"


@pytest.mark.parametrize(
    "change",
    [
        *(_change_test, _change_alpha, _move_event, _link_rig, _move_time),
        *(_change_gain, _change_certificate),
    ],
)
def test_a_run_of_version_1_that_contradicts_itself_is_bad(
    run: Path, without_seal, change: Callable[[h5py.File], None]
) -> None:
    without_seal(run)
    with h5py.File(run, "r+") as file:
        change(file)
    assert not verify(run).ok


def _with_endless_text(path: Path) -> None:
    """Objects of size zero in the heap of texts: the HDF5 library reads it for ever."""
    content = bytearray(path.read_bytes())
    at = content.find(b"GCOL")
    assert at > 0
    size = int.from_bytes(content[at + 8 : at + 16], "little")
    content[at + 16 : at + size] = bytes(size - 16)
    path.write_bytes(content)


def test_a_file_that_is_read_for_ever_is_given_up(run: Path, without_seal) -> None:
    prober = Prober(cpu_limit_s=1.0)
    try:
        prober.prove(without_seal(run))
        sound = run.read_bytes()
        _with_endless_text(run)
        with pytest.raises(RunFileError, match=r"does not end|memory|damaged"):
            prober.prove(run)
        run.write_bytes(sound)
        prober.prove(run)
    finally:
        prober.close()


def test_a_zeroed_heap_of_a_sealed_run_is_never_seen_by_the_library(run: Path) -> None:
    _with_endless_text(run)
    assert "are not the ones that were saved" in verify(run).problems[0]
    with pytest.raises(RunFileError):
        open_run(run)


def test_a_reader_without_hdf5_proves_the_seal(run: Path, repository: Path) -> None:
    def told() -> str:
        command = [sys.executable, "-S", str(repository / "docs" / "reference" / "seal_reader.py"), str(run)]
        return subprocess.run(command, capture_output=True, text=True, check=False).stdout

    assert "every byte is the one that was sealed" in told()
    content = bytearray(run.read_bytes())
    content[-10] ^= 1
    run.write_bytes(content)
    assert "changed: bytes" in told()

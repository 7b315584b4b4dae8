"""Seals: nothing can be changed after the sealing, nothing can be read from a seal."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from daq_app.gap.blind.layout import SEAL_FILE
from daq_app.gap.blind.seal import SealBroken, open_label, seal_case

LABEL = {"case": "case_0001", "category": "single", "effects": [{"name": "viscous"}]}


@pytest.fixture
def sealed(tmp_path: Path) -> tuple[Path, Path]:
    case = tmp_path / "cases" / "case_0001"
    case.mkdir(parents=True)
    (case / "FR1-L1-1.h5").write_bytes(b"readings")
    (case / "rig.toml").write_text("name = 'fr1'", encoding="utf-8")
    label = tmp_path / "labels" / "case_0001.json"
    seal_case(case, LABEL, label)
    return case, label


def test_an_untouched_label_opens(sealed: tuple[Path, Path]) -> None:
    assert open_label(*sealed) == LABEL


def test_an_altered_label_is_detected(sealed: tuple[Path, Path]) -> None:
    case, label = sealed
    label.write_text(label.read_text(encoding="utf-8").replace("viscous", "coulomb"), encoding="utf-8")
    with pytest.raises(SealBroken, match="not the one that was sealed"):
        open_label(case, label)


@pytest.mark.parametrize("name", ["FR1-L1-1.h5", "rig.toml"])
def test_an_altered_file_is_detected(sealed: tuple[Path, Path], name: str) -> None:
    case, label = sealed
    (case / name).write_bytes(b"other")
    with pytest.raises(SealBroken, match=f"{name} was changed"):
        open_label(case, label)


def test_added_and_missing_files_are_detected(sealed: tuple[Path, Path]) -> None:
    case, label = sealed
    (case / "hint.txt").write_text("viscous", encoding="utf-8")
    with pytest.raises(SealBroken, match=r"hint\.txt was added"):
        open_label(case, label)
    (case / "hint.txt").unlink()
    (case / "rig.toml").unlink()
    with pytest.raises(SealBroken, match=r"rig\.toml is missing"):
        open_label(case, label)


def test_a_missing_or_broken_label_is_told(sealed: tuple[Path, Path]) -> None:
    case, label = sealed
    with pytest.raises(SealBroken, match="there is no label"):
        open_label(case, label.with_name("case_0002.json"))
    label.write_text("{", encoding="utf-8")
    with pytest.raises(SealBroken, match="cannot be read"):
        open_label(case, label)


def test_the_hash_cannot_be_tried_without_the_salt(sealed: tuple[Path, Path]) -> None:
    case, label = sealed
    seal = json.loads((case / SEAL_FILE).read_text(encoding="utf-8"))
    text = json.dumps(LABEL, ensure_ascii=False, sort_keys=True)
    assert seal["label_sha256"] != hashlib.sha256(text.encode()).hexdigest()
    kept = json.loads(label.read_text(encoding="utf-8"))
    assert len(kept["salt"]) == 64
    salted = hashlib.sha256(bytes.fromhex(kept["salt"]) + text.encode()).hexdigest()
    assert seal["label_sha256"] == salted  # anybody can check it once the salt is out
    assert "viscous" not in (case / SEAL_FILE).read_text(encoding="utf-8")


def test_two_sealings_of_one_label_differ(sealed: tuple[Path, Path]) -> None:
    case, label = sealed
    before = json.loads((case / SEAL_FILE).read_text(encoding="utf-8"))["label_sha256"]
    seal_case(case, LABEL, label)
    after = json.loads((case / SEAL_FILE).read_text(encoding="utf-8"))["label_sha256"]
    assert before != after

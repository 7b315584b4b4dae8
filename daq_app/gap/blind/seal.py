"""Labels kept apart, and the seal that ties them to their case.

Beside each case stands ``seal.json``: the SHA-256 of salt and label, and of every file of the case.
The salt (256 random bits) is with the label, so that nobody can try labels against the hash; at the
opening anybody can check that neither label nor case was changed since.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import secrets
from pathlib import Path
from typing import Any, Final

from daq_app.gap.blind.layout import SEAL_FILE
from daq_app.runfile.digest import file_sha256

_FORMAT: Final = 1


class SealBroken(Exception):
    """A label or a file of a case is not what was sealed."""


def seal_case(folder: Path, label: dict[str, Any], label_path: Path) -> None:
    """Write the label with a fresh salt to `label_path`, and the seal into the case's folder."""
    salt = secrets.token_hex(32)
    text = json.dumps(label, ensure_ascii=False, allow_nan=False, sort_keys=True)
    label_path.parent.mkdir(parents=True, exist_ok=True)
    label_path.write_text(
        json.dumps({"format": _FORMAT, "salt": salt, "label": text}, ensure_ascii=False, indent=1),
        encoding="utf-8",
    )
    seal = {
        "format": _FORMAT,
        "case": folder.name,
        "label_sha256": _label_sha256(salt, text),
        "files": _file_hashes(folder),
    }
    (folder / SEAL_FILE).write_text(json.dumps(seal, indent=1), encoding="utf-8")


def open_label(folder: Path, label_path: Path) -> dict[str, Any]:
    """The label, once its hash and those of all files of the case are proven.

    Raises `SealBroken` that says what was changed, or what is missing.
    """
    seal = read_seal(folder)
    try:
        kept = json.loads(label_path.read_text(encoding="utf-8"))
        salt, text = str(kept["salt"]), str(kept["label"])
    except FileNotFoundError:
        raise SealBroken(f"{folder.name}: there is no label {label_path}") from None
    except (ValueError, KeyError, TypeError) as error:
        raise SealBroken(f"{folder.name}: the label {label_path} cannot be read ({error})") from None
    if not hmac.compare_digest(_label_sha256(salt, text), str(seal["label_sha256"])):
        raise SealBroken(f"{folder.name}: the label {label_path} is not the one that was sealed")
    check_files(folder, seal)
    label: dict[str, Any] = json.loads(text)
    return label


def read_seal(folder: Path) -> dict[str, Any]:
    """The published seal of a case."""
    path = folder / SEAL_FILE
    try:
        seal: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        if {"label_sha256", "files"} <= seal.keys():
            return seal
    except FileNotFoundError:
        raise SealBroken(f"{folder.name}: there is no {SEAL_FILE}") from None
    except ValueError as error:
        raise SealBroken(f"{folder.name}: {SEAL_FILE} cannot be read ({error})") from None
    raise SealBroken(f"{folder.name}: {SEAL_FILE} is incomplete")


def check_files(folder: Path, seal: dict[str, Any]) -> None:
    """Raise `SealBroken` unless the files of the case are exactly those that were sealed."""
    hashes = _file_hashes(folder)
    for name in sorted(hashes.keys() | seal["files"].keys()):
        if name not in hashes:
            raise SealBroken(f"{folder.name}: {name} is missing")
        if name not in seal["files"]:
            raise SealBroken(f"{folder.name}: {name} was added after the sealing")
        if hashes[name] != seal["files"][name]:
            raise SealBroken(f"{folder.name}: {name} was changed after the sealing")


def _file_hashes(folder: Path) -> dict[str, str]:
    paths = sorted(p for p in folder.iterdir() if p.is_file() and p.name != SEAL_FILE)
    return {path.name: file_sha256(path) for path in paths}


def _label_sha256(salt: str, text: str) -> str:
    return hashlib.sha256(bytes.fromhex(salt) + text.encode()).hexdigest()

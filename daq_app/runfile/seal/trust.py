"""Other recorders whose seals this user believes: one file per key, named after the recorder."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from daq_app.runfile.durable import write_whole
from daq_app.runfile.errors import RunFileError
from daq_app.runfile.seal.format import KEY_BYTES, Seal
from daq_app.runfile.seal.signing import key_file, made_here, signature_is_good

_SUFFIX: Final = ".sealkey"
_KEY: Final = re.compile(rf"[0-9a-fA-F]{{{2 * KEY_BYTES}}}")
_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,59}")


def trusted_folder() -> Path:
    """Where the trusted keys of this user lie, beside the user's own."""
    return key_file().parent / "trusted-recorders"


def trusted_keys() -> dict[str, str]:
    """Name of each trusted recorder → its public key in hexadecimal; files that hold none are left out."""
    keys = {}
    for path in sorted(trusted_folder().glob(f"*{_SUFFIX}")):
        try:
            key = path.read_text(encoding="ascii").strip()
        except (OSError, ValueError):
            continue
        if _KEY.fullmatch(key):
            keys[path.stem] = key.lower()
    return keys


def trust(name: str, key: str, *, replace: bool = False) -> Path:
    """Believe the seals of a key from now on; returns its file. Raises `RunFileError`, `OSError`."""
    if not _NAME.fullmatch(name):
        raise RunFileError(f"'{name}' is no name of a recorder", advice="Letters, digits, '-' and '_'.")
    if not _KEY.fullmatch(key):
        raise RunFileError(
            "that is no key of a recorder",
            advice="`daq-app keys seal`, on the machine that records, prints it: 64 hexadecimal digits.",
        )
    path = trusted_folder() / f"{name}{_SUFFIX}"
    if not replace and trusted_keys().get(name, key.lower()) != key.lower():
        raise RunFileError(
            f"another key is trusted as {name} already",
            advice="Choose another name, or say --replace if that recorder has a new key.",
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    return write_whole(path, f"{key.lower()}\n")


def distrust(name: str) -> None:
    """Believe that recorder no more. Raises `RunFileError` where none of that name is trusted, `OSError`."""
    if name not in trusted_keys():
        raise RunFileError(f"no recorder is trusted as '{name}'", advice="`daq-app keys trusted` lists them.")
    (trusted_folder() / f"{name}{_SUFFIX}").unlink()


def trusted_as(seal: Seal) -> str | None:
    """Name of the trusted recorder that sealed a file; None for a stranger or a wrong signature."""
    key = seal.public_key.hex()
    name = next((name for name, known in trusted_keys().items() if known == key), None)
    return name if name is not None and signature_is_good(seal) else None


def is_believed(seal: Seal) -> bool:
    """Whether this machine or a trusted one sealed the file: then this program wrote what it holds."""
    return made_here(seal) or trusted_as(seal) is not None

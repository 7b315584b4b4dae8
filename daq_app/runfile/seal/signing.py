"""Who sealed a run: every machine that saves runs has an Ed25519 key of its own (RFC 8032).

A hash tells damage; it can be made anew by whoever edits a file.  The signature of the hash cannot.
"""

from __future__ import annotations

import contextlib
import os
from functools import lru_cache
from pathlib import Path
from typing import Final

import platformdirs
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from daq_app.runfile.seal.format import KEY_BYTES, Seal

_NAME: Final = "seal.key"


def key_file() -> Path:
    """Where this user's key lies on this machine."""
    return platformdirs.user_config_path("rocking-test-recorder", appauthor=False) / _NAME


def sign(root: bytes) -> tuple[bytes, bytes]:
    """(public key, signature) by this machine's key, made at first use; zeros where none can be kept."""
    key = _private_key(key_file())
    if key is None:
        return bytes(KEY_BYTES), bytes(64)
    return key.public_key().public_bytes_raw(), key.sign(root)


def own_public_key() -> bytes:
    """This machine's public key; empty if it has none and none can be kept."""
    key = _private_key(key_file())
    return b"" if key is None else key.public_key().public_bytes_raw()


def signature_is_good(seal: Seal) -> bool:
    """Whether the seal was signed by the owner of the key that it names."""
    try:
        Ed25519PublicKey.from_public_bytes(seal.public_key).verify(seal.signature, seal.root)
    except (InvalidSignature, ValueError):
        return False
    return True


def made_here(seal: Seal) -> bool:
    """Whether this machine sealed the file: then what it holds was written by this program."""
    public_key = own_public_key()
    return bool(public_key) and seal.public_key == public_key and signature_is_good(seal)


@lru_cache(maxsize=4)
def _private_key(path: Path) -> Ed25519PrivateKey | None:
    """The key of a file, made if there is none; None where it can neither be read nor made."""
    for _ in range(2):  # another process may make it at the same moment
        with contextlib.suppress(OSError, ValueError):
            return Ed25519PrivateKey.from_private_bytes(path.read_bytes())
        with contextlib.suppress(OSError):
            _create(path, Ed25519PrivateKey.generate())
    return None


def _create(path: Path, key: Ed25519PrivateKey) -> None:
    """Write the key beside its name and link it there whole: nobody reads half a key, none is replaced."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f"{path.name}.{os.getpid()}")
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | getattr(os, "O_BINARY", 0)
    try:
        with os.fdopen(os.open(beside, flags, 0o600), "wb") as file:
            file.write(key.private_bytes_raw())
        try:
            os.link(beside, path)
        except FileExistsError:
            return
        except OSError:  # a file system without hard links
            if not path.exists():
                beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)

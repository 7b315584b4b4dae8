"""Keys for viewers beyond this machine (CURVE): who has none is not heard.

A folder holds them: ``recorder.key`` / ``recorder.key_secret`` of the acquisition, and in ``viewers/`` the
public key of every viewer that may listen: who is removed from there is not heard any more. The right to
command is a further thing: the token.
"""

from __future__ import annotations

import ipaddress
import tempfile
from pathlib import Path
from urllib.parse import urlsplit

import zmq
import zmq.auth

RECORDER = "recorder"
VIEWERS = "viewers"


class KeyFileError(Exception):
    """Keys that are missing or cannot be used, and what to do."""


def is_loopback(endpoint: str) -> bool:
    """Whether a ``tcp://HOST:PORT`` endpoint can be reached from this machine only."""
    host = urlsplit(endpoint).hostname or ""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def create_recorder_keys(folder: Path) -> Path:
    """Make the recorder's key pair and the empty folder of viewers; returns the public key's file.

    Raises `KeyFileError` if the folder holds keys already, `OSError` if it cannot be written to.
    """
    public, _ = _create_pair(folder, RECORDER, "every viewer has stored the public one")
    (folder / VIEWERS).mkdir(exist_ok=True)
    return public


def create_viewer_keys(folder: Path, name: str) -> tuple[Path, Path]:
    """Make a viewer's key pair. Put the public file into the recorder's ``viewers/``; keep the secret one.

    Raises what `create_recorder_keys` raises.
    """
    return _create_pair(folder, name, "the recorder admits this viewer by it")


def _create_pair(folder: Path, name: str, who_relies_on_it: str) -> tuple[Path, Path]:
    """(public file, secret file); the secret one is never readable by others, not even for a moment."""
    names = (f"{name}.key", f"{name}.key_secret")
    for there in (folder / file for file in names):
        if there.exists() or there.is_symlink():
            raise KeyFileError(
                f"{there} exists already, and {who_relies_on_it}: nothing was changed. To make new keys, "
                "move it away first; the new public key then has to be handed out again"
            )
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder) as private:
        for made in zmq.auth.create_certificates(private, name):
            if made is not None:
                Path(made).chmod(0o600 if made.endswith("_secret") else 0o644)
        for file in names:
            (Path(private) / file).rename(folder / file)
    return folder / names[0], folder / names[1]


class ViewerKeys:
    """The viewer's side: its own secret file and the recorder's public one. Raises `KeyFileError`."""

    def __init__(self, viewer_secret: Path, recorder_public: Path) -> None:
        self._public_key, self._secret_key = load_key(viewer_secret)
        self._server_key, _ = load_key(recorder_public, secret=False)

    def apply(self, socket: zmq.Socket[bytes]) -> None:
        """Call before `connect`."""
        socket.curve_publickey = self._public_key
        socket.curve_secretkey = self._secret_key
        socket.curve_serverkey = self._server_key


def load_key(path: Path, *, secret: bool = True) -> tuple[bytes, bytes]:
    """(public, secret) of a key file; the secret one is empty where it is not asked for and not there.

    Raises `KeyFileError`.
    """
    try:
        public_key, secret_key = zmq.auth.load_certificate(path)
    except (OSError, ValueError) as error:
        raise KeyFileError(f"{path} is no key file ({error})") from error
    if secret and secret_key is None:
        raise KeyFileError(f"{path} holds a public key only; the .key_secret file is needed here")
    return public_key, secret_key or b""

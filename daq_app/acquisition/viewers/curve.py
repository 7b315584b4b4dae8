"""Keys for viewers beyond this machine (CURVE): who has none is not heard.

A folder holds them: ``recorder.key`` / ``recorder.key_secret`` of the acquisition, and in ``viewers/`` the
public key of every viewer that may listen: who is removed from there is not heard any more. The right to
command is a further thing: the token.
"""

from __future__ import annotations

import contextlib
import ipaddress
import tempfile
from pathlib import Path
from urllib.parse import urlsplit

import zmq
import zmq.auth
from zmq.auth.thread import ThreadAuthenticator

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


class Admitted:
    """The viewers whose public keys lie in a folder at this moment: a key that is removed ends its right."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._before = self.keys()

    def keys(self) -> frozenset[bytes]:
        """Public keys of all viewers; a file that is no key admits nobody."""
        found = set()
        for path in self._folder.glob("*.key"):
            with contextlib.suppress(KeyFileError):
                found.add(_load(path, secret=False)[0])
        return frozenset(found)

    def callback(self, domain: str, key: bytes) -> bool:
        """Whether a viewer that connects now is admitted (called by the library, on its thread)."""
        return key in self.keys()

    def somebody_was_removed(self) -> bool:
        """Whether a key that was there at the last call is there no more."""
        before, self._before = self._before, self.keys()
        return not before <= self._before


def secure_server(context: zmq.Context[zmq.Socket[bytes]], folder: Path) -> ServerKeys:
    """Start to admit the viewers of `folder` only. Raises `KeyFileError`."""
    secret = folder / f"{RECORDER}.key_secret"
    viewers = folder / VIEWERS
    if not secret.is_file() or not viewers.is_dir():
        raise KeyFileError(
            f"{folder} holds no keys of the recorder. Make them with: daq-app keys recorder {folder}"
        )
    public_key, secret_key = _load(secret)
    authenticator = ThreadAuthenticator(context)
    authenticator.start()
    admitted = Admitted(viewers)
    authenticator.configure_curve_callback(domain="*", credentials_provider=admitted)
    return ServerKeys(authenticator, admitted, public_key, secret_key)


class ServerKeys:
    """The recorder's side of CURVE: `apply` it to each socket before it is bound."""

    def __init__(
        self, authenticator: ThreadAuthenticator, admitted: Admitted, public_key: bytes, secret_key: bytes
    ) -> None:
        self._authenticator = authenticator
        self.admitted = admitted
        self._public_key = public_key
        self._secret_key = secret_key

    def apply(self, socket: zmq.Socket[bytes]) -> None:
        """Make the socket refuse everybody without a known key."""
        socket.curve_server = True
        socket.curve_publickey = self._public_key
        socket.curve_secretkey = self._secret_key

    def close(self) -> None:
        """End the authenticator's thread."""
        self._authenticator.stop()


class ViewerKeys:
    """The viewer's side: its own secret file and the recorder's public one. Raises `KeyFileError`."""

    def __init__(self, viewer_secret: Path, recorder_public: Path) -> None:
        self._public_key, self._secret_key = _load(viewer_secret)
        self._server_key, _ = _load(recorder_public, secret=False)

    def apply(self, socket: zmq.Socket[bytes]) -> None:
        """Call before `connect`."""
        socket.curve_publickey = self._public_key
        socket.curve_secretkey = self._secret_key
        socket.curve_serverkey = self._server_key


def _load(path: Path, *, secret: bool = True) -> tuple[bytes, bytes]:
    try:
        public_key, secret_key = zmq.auth.load_certificate(path)
    except (OSError, ValueError) as error:
        raise KeyFileError(f"{path} is no key file ({error})") from error
    if secret and secret_key is None:
        raise KeyFileError(f"{path} holds a public key only; the .key_secret file is needed here")
    return public_key, secret_key or b""

"""Keys for viewers beyond this machine (CURVE): who has none is not heard.

A folder holds them: ``recorder.key`` / ``recorder.key_secret`` of the acquisition, and in ``viewers/`` the
public key of every viewer that may listen. The right to command is a further thing: the token.
"""

from __future__ import annotations

import ipaddress
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
    """Make the recorder's key pair and the empty folder of viewers; returns the public key's file."""
    (folder / VIEWERS).mkdir(parents=True, exist_ok=True)
    public, secret = zmq.auth.create_certificates(folder, RECORDER)
    Path(secret).chmod(0o600)
    return Path(public)


def create_viewer_keys(folder: Path, name: str) -> tuple[Path, Path]:
    """Make a viewer's key pair. Put the public file into the recorder's ``viewers/``; keep the secret one."""
    folder.mkdir(parents=True, exist_ok=True)
    public, secret = zmq.auth.create_certificates(folder, name)
    Path(secret).chmod(0o600)
    return Path(public), Path(secret)


def secure_server(context: zmq.Context[zmq.Socket[bytes]], folder: Path) -> ServerKeys:
    """Start to admit the viewers of `folder` only. Raises `KeyFileError`."""
    secret = folder / f"{RECORDER}.key_secret"
    viewers = folder / VIEWERS
    if not secret.is_file() or not viewers.is_dir():
        raise KeyFileError(
            f"{folder} holds no keys of the recorder. Make them with: daq-app keys recorder {folder}"
        )
    authenticator = ThreadAuthenticator(context)
    authenticator.start()
    authenticator.configure_curve(domain="*", location=str(viewers))
    public_key, secret_key = _load(secret)
    return ServerKeys(authenticator, public_key, secret_key)


class ServerKeys:
    """The recorder's side of CURVE: `apply` it to each socket before it is bound."""

    def __init__(self, authenticator: ThreadAuthenticator, public_key: bytes, secret_key: bytes) -> None:
        self._authenticator = authenticator
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

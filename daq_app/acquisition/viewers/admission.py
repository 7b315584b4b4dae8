"""The recorder's side of the keys: which viewers it hears."""

from __future__ import annotations

import contextlib
from pathlib import Path

import zmq
from zmq.auth.thread import ThreadAuthenticator

from daq_app.acquisition.viewers.curve import RECORDER, VIEWERS, KeyFileError, load_key


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
                found.add(load_key(path, secret=False)[0])
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
    public_key, secret_key = load_key(secret)
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

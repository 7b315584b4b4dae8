"""Client of the simulated hardware's control service."""

from __future__ import annotations

import json
from typing import Any

import grpc


class SimControlError(Exception):
    """The simulator refused a command, or could not be reached."""


class SimControl:
    """Commands to a simulated device server at ``HOST:PORT`` (``grpc://`` in front is allowed)."""

    def __init__(self, address: str, timeout_s: float = 10.0) -> None:
        self._channel = grpc.insecure_channel(address.removeprefix("grpc://"))
        self._call = self._channel.unary_unary("/rocking.SimControl/Command")
        self._timeout_s = timeout_s

    def command(self, name: str, **arguments: float | str) -> dict[str, Any]:
        """Carry out a command and return its answer. Raises `SimControlError` in words."""
        message = json.dumps({"name": name, "arguments": arguments}).encode()
        try:
            reply: dict[str, Any] = json.loads(self._call(message, timeout=self._timeout_s))
        except grpc.RpcError as error:
            raise SimControlError(f"{name}: {error.details()}") from None
        return reply

    def close(self) -> None:
        self._channel.close()

    def __enter__(self) -> SimControl:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

"""Where the NI driver is: ``local``, ``simulated`` or ``grpc://HOST:PORT``."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

_GRPC = re.compile(
    r"grpc://(?P<host>\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9](?:[A-Za-z0-9._-]*[A-Za-z0-9])?):(?P<port>\d{1,5})"
)


@dataclass(frozen=True, slots=True)
class Connection:
    """A parsed connection string."""

    kind: Literal["local", "simulated", "grpc"]
    host: str = ""
    port: int = 0


def parse_connection(text: str) -> Connection:
    """The connection that `text` names. Raises `ValueError` with what would be right."""
    if text == "local":
        return Connection("local")
    if text == "simulated":
        return Connection("simulated")
    match = _GRPC.fullmatch(text)
    if match and 1 <= int(match["port"]) <= 65535:
        return Connection("grpc", match["host"], int(match["port"]))
    raise ValueError(
        'Write "local" (the NI driver of this machine), "simulated", or "grpc://HOST:PORT" with a port '
        "from 1 to 65535, for instance grpc://192.168.1.20:31763"
    )

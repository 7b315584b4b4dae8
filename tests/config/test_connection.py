"""Connection strings."""

from __future__ import annotations

import pytest

from daq_app.config import Connection, parse_connection


@pytest.mark.parametrize(
    ("text", "connection"),
    [
        ("local", Connection("local")),
        ("simulated", Connection("simulated")),
        ("grpc://daq-pc.lab:31763", Connection("grpc", "daq-pc.lab", 31763)),
        ("grpc://127.0.0.1:1", Connection("grpc", "127.0.0.1", 1)),
        ("grpc://[::1]:65535", Connection("grpc", "[::1]", 65535)),
    ],
)
def test_reads(text: str, connection: Connection) -> None:
    assert parse_connection(text) == connection


@pytest.mark.parametrize(
    "text",
    ["", "Local", "grpc://", "grpc://host", "grpc://host:0", "grpc://host:65536", "grpc://:1", "host:1",
     "grpc://a b:1", "grpc://host:1/x", "tcp://host:1", "grpc://-a:1"],
)  # fmt: skip
def test_refuses_with_the_right_form(text: str) -> None:
    with pytest.raises(ValueError, match="grpc://HOST:PORT"):
        parse_connection(text)

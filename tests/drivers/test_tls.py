"""The NI driver through TLS: what `grpcs://` promises, and what it refuses.

NI's tool for certificates is not on a machine without NI software: a script that answers as it does takes
its place, and a relay that speaks TLS stands before the simulated device server.
"""

from __future__ import annotations

import json
import os
import socket
import ssl
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import trustme

from drivers import DriverError, open_driver
from tests.support.recorder.relay import Relay

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the stand-in for NI's tool is a script")


class TlsRelay(Relay):
    """Takes TLS connections."""

    def __init__(self, port: int, authority: trustme.CA) -> None:
        self._context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        authority.issue_cert("localhost").configure_cert(self._context)
        authority.configure_trust(self._context)
        self._context.verify_mode = ssl.CERT_REQUIRED  # both sides show who they are
        self._context.set_alpn_protocols(["h2"])
        self.handshakes = 0
        super().__init__(port)

    def let_in(self, plain: socket.socket) -> socket.socket | None:
        try:
            front = self._context.wrap_socket(plain, server_side=True)
        except OSError:
            return None
        self.handshakes += 1
        return front


@pytest.fixture
def lab(laboratory: Callable[..., Any]) -> Any:
    return laboratory()


@pytest.fixture(scope="module")
def authority() -> trustme.CA:
    """Who both sides trust."""
    return trustme.CA()


@pytest.fixture
def relay(lab: Any, authority: trustme.CA) -> Iterator[TlsRelay]:
    made = TlsRelay(lab.server.port, authority)
    yield made
    made.close()


@pytest.fixture
def configured(authority: trustme.CA, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """What NI's tool says of this machine's TLS settings."""

    def write(trusted: trustme.CA = authority, server_mode: str = "TrustedCertificates") -> None:
        own = authority.issue_cert("operator")
        answer = {
            "client": [
                {
                    "service_name": "ni-grpc-device",
                    "certificate_mode": "Managed",
                    "certificate_chain_contents": own.cert_chain_pems[0].bytes().decode(),
                    "certificate_key_contents": own.private_key_pem.bytes().decode(),
                    "server_mode": server_mode,
                    "trusted_certificates_location": "File://trusted.pem",
                    "trusted_certificates_contents": trusted.cert_pem.bytes().decode(),
                }
            ]
        }
        (tmp_path / "answer.json").write_text(json.dumps(answer), encoding="utf-8")
        tool = tmp_path / "nitlsconfig"
        tool.write_text(f'#!/bin/sh\ncat "{tmp_path / "answer.json"}"\n', encoding="utf-8")
        tool.chmod(0o755)
        monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")

    return write


def test_samples_come_through_tls(lab: Any, relay: TlsRelay, configured: Callable[..., None]) -> None:
    configured()
    driver = open_driver(f"grpcs://localhost:{relay.port}")
    try:
        opened = driver.open(lab.plan)
        driver.start()
        block = driver.read(5.0)
    finally:
        driver.close()
    assert opened.rate_hz == 4000.0 and block.readings.shape[0] == 41
    assert relay.handshakes >= 1, "nothing went past the encryption"


def test_a_server_that_is_not_trusted_is_not_talked_to(
    lab: Any, relay: TlsRelay, configured: Callable[..., None]
) -> None:
    configured(trusted=trustme.CA())
    driver = open_driver(f"grpcs://localhost:{relay.port}")
    with pytest.raises(DriverError) as told:
        driver.open(lab.plan)
    driver.close()
    assert relay.handshakes == 0
    assert "ertificate" in f"{told.value} {told.value.advice}"


def test_tls_that_is_switched_off_on_this_machine_is_no_tls(configured: Callable[..., None]) -> None:
    """NI's channel would be plain then, though the address says otherwise."""
    configured(server_mode="Disabled")
    with pytest.raises(DriverError, match="switched off"):
        open_driver("grpcs://localhost:31763")


def test_a_machine_without_nis_tool_is_told_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(DriverError, match="not set up on this machine"):
        open_driver("grpcs://localhost:31763")

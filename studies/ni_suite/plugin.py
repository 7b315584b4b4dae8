"""pytest plugin inside NI's suite: its server process becomes ours, and only its gRPC tests are kept.

NI's fixtures start `ni_grpc_device_server.exe`, which exists on Windows only. Here the address of a
running simulated server is taken from the environment instead. Names of encodings compare without case:
the suite asks for "utf-8" where Linux says "UTF-8". Nothing else of the suite is changed.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import grpc
import nidaqmx
import pytest
from nidaqmx import _lib
from nidaqmx.system import System

PORT_VARIABLE = "NI_SUITE_PORT"
RESULTS_VARIABLE = "NI_SUITE_RESULTS"


def _start(self: Any) -> None:
    self.server_port = int(os.environ[PORT_VARIABLE])


def _leave(self: Any, *_: object) -> None:
    """The server belongs to whoever started this run."""


def _uses_grpc(item: pytest.Item) -> bool:
    callspec = getattr(item, "callspec", None)
    return callspec is not None and "grpc_init_kwargs" in map(str, callspec.params.values())


class Results:
    """One line of JSON for each test: where it is, how it ended, why."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._outcomes: dict[str, tuple[str, str]] = {}

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        utilities = sys.modules["tests._grpc_utils"]
        utilities.GrpcServerProcess.__init__ = _start
        utilities.GrpcServerProcess.__exit__ = _leave
        dropped = [item for item in items if not _uses_grpc(item)]
        items[:] = [item for item in items if _uses_grpc(item)]
        config.hook.pytest_deselected(items=dropped)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """The worst phase of a test decides; a test that its own fixture skips never started."""
        # Expected failures count as passed, and so do tests that pass although NI's own server fails them.
        expected = hasattr(report, "wasxfail") and report.outcome != "failed"
        outcome = "passed" if expected else report.outcome
        if report.when != "call" and outcome == "passed":
            return
        if report.when == "call" or self._outcomes.get(report.nodeid, ("passed",))[0] == "passed":
            self._outcomes[report.nodeid] = (outcome, _reason(report))

    def pytest_sessionfinish(self) -> None:
        rows = [{"test": test, "outcome": o, "reason": r} for test, (o, r) in self._outcomes.items()]
        self._path.write_text("\n".join(map(json.dumps, rows)) + "\n", encoding="utf-8")


def _reason(report: pytest.TestReport) -> str:
    """The last line of an error, or the sentence of a skip."""
    if report.outcome == "skipped" and isinstance(report.longrepr, tuple):
        return str(report.longrepr[2])
    crash = getattr(report.longrepr, "reprcrash", None)
    return str(crash.message) if crash is not None else str(report.longrepr or "")[-300:]


def pytest_configure(config: pytest.Config) -> None:
    """Conditions of some tests ask the local driver for its version as they are collected."""
    channel = grpc.insecure_channel(f"127.0.0.1:{os.environ[PORT_VARIABLE]}")
    options = nidaqmx.GrpcSessionOptions(channel, "")
    System.local = staticmethod(lambda: System.remote(options))
    encoding = _lib.get_encoding_from_locale()
    _lib.get_encoding_from_locale = encoding.lower
    config.pluginmanager.register(Results(Path(os.environ[RESULTS_VARIABLE])), "ni-suite-results")

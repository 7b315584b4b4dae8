"""Servers and processes for the faults, and the table that is printed at the end."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from daq_app.acquisition.process.simulated import SimulatedServer
from daq_app.config import Rig, load_rig
from sim_hardware.control import SimControl
from tests.support.recorder.fault_bench import SPEED, Acquisition, Row, RunFacts, Standing, Start, Told
from tests.support.recorder.processes import free_the_hardware

_KEY = "fault row"


@pytest.fixture(scope="session")
def rig_file(configs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """FR1 with a wall that comes to rest soon."""
    text = (configs / "fr1.toml").read_text(encoding="utf-8")
    for old, new in (
        ("restitution = 0.895", "restitution = 0.7"),
        ("post_rest_s = 2.0", "post_rest_s = 0.5"),
    ):
        assert old in text
        text = text.replace(old, new)
    path = tmp_path_factory.mktemp("rig") / "quick.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def rig(rig_file: Path) -> Rig:
    return load_rig(rig_file)


@pytest.fixture(scope="module")
def server(rig_file: Path, request: pytest.FixtureRequest) -> Iterator[SimulatedServer]:
    """A simulated chassis; the module's `WALL` says what is wired to it."""
    wall = getattr(request.module, "WALL", "marked")
    with SimulatedServer(rig_file, ["--speed", str(SPEED), "--wall", wall]) as started:
        assert started.connection
        yield started


@pytest.fixture
def bench(server: SimulatedServer) -> Iterator[SimControl]:
    """The way to break the simulated hardware; mended after each test."""
    with SimControl(server.connection) as control:
        yield control
        control.command("clear_faults")


@pytest.fixture
def start(
    rig_file: Path, rig: Rig, server: SimulatedServer, standing: Standing, tmp_path: Path
) -> Iterator[Start]:
    """Start an acquisition of the test's own on the module's server, in the place of the standing one."""
    made: list[Acquisition] = []

    def make(*options: str, out: str = "runs", connection: str = "") -> Acquisition:
        where = connection or server.connection
        if where == server.connection:
            standing.end()
        made.append(Acquisition(rig_file, rig, tmp_path / out, where, "--speed", str(SPEED), *options))
        return made[-1]

    yield make
    for one in made:
        if one.process.exitcode is None:
            one.kill()
            free_the_hardware(one.connection)


@pytest.fixture(scope="module")
def standing(
    rig_file: Path, rig: Rig, server: SimulatedServer, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Standing]:
    """One acquisition for the tests of a module: each arms a run of its own."""

    def make() -> Acquisition:
        out = tmp_path_factory.mktemp("shared") / "runs"
        options = ("--speed", str(SPEED), "--reconnect-within", "20")
        return Acquisition(rig_file, rig, out, server.connection, *options)

    made = Standing(make)
    yield made
    made.end()


@pytest.fixture
def shared(standing: Standing) -> Acquisition:
    """The standing acquisition."""
    return standing.living()


@pytest.fixture
def row(record_property: Callable[[str, object], None]) -> Row:
    """Put a line into the table of the faults."""

    def put(fault: str, told: Told | None, facts: RunFacts | None, note: str = "") -> None:
        record_property(
            _KEY,
            {
                "fault": fault,
                "after_s": None if told is None else round(told.after_s, 2),
                "told": note if told is None else told.text,
                "lost": None if facts is None else facts.lost,
                "gap_table": None if facts is None else facts.in_gap_table,
                "verdict": "no run" if facts is None else facts.verdict,
            },
        )

    return put


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Print the table, and write it where FAULT_TABLE says."""
    rows: list[dict[str, Any]] = [
        value
        for outcome in ("passed", "failed")
        for report in terminalreporter.stats.get(outcome, [])
        for name, value in getattr(report, "user_properties", ())
        if name == _KEY and report.when == "call"
    ]
    if not rows:
        return
    if target := os.environ.get("FAULT_TABLE"):
        Path(target).write_text(json.dumps(rows, indent=1, ensure_ascii=False), encoding="utf-8")
    terminalreporter.section(
        "faults: detected after, samples lost = in the table of gaps, verdict, what was told"
    )
    for entry in rows:
        after = "   –   " if entry["after_s"] is None else f"{entry['after_s']:5.2f} s"
        lost = "–" if entry["lost"] is None else f"{entry['lost']} = {entry['gap_table']}"
        told = entry["told"]
        terminalreporter.write_line(
            f"{entry['fault'][:44]:44s} {after}  {lost:>15s}  {entry['verdict']:7s} {told[:90]}"
        )

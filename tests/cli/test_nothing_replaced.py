"""No command replaces a file unasked, and none leaves half of one when the disk refuses."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from daq_app.cli.app import build_app
from daq_app.runfile import JournalWriter, RunFileError, RunHeader, finalise, open_run, verify

OLD = b"somebody's work"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A small run in a folder of its own."""
    folder = tmp_path / "runs"
    folder.mkdir()
    header = RunHeader(run_id="a", test="FR1-L1-1", channel_ids=("A",), reading_units=("V",), rate_hz=100.0)
    with JournalWriter(folder / "a.journal", header) as writer:
        writer.append_block(0, np.arange(100.0)[None, :])
        writer.append_event("released", 10, "released")
    return finalise(folder / "a.journal", folder / "a.h5", keep_journal=False)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


Command = Callable[[Path, Path, Path], list[object]]
"""(run, folder to write into, rig file) to the arguments."""
COMMANDS: dict[str, tuple[str, Command]] = {
    "analyse": ("a.analysis.json", lambda run, out, rig: ["analyse", run, "--out", out]),
    "record": ("r.pdf", lambda run, out, rig: ["campaign", "record", run, "--out", out / "r.pdf"]),
    "report": ("report.html", lambda run, out, rig: ["campaign", "report", run.parent, "--out", out]),
    "export": (
        "a.csv",
        lambda run, out, rig: ["export", run, "--raw", "--format", "csv", "--out", out / "a.csv"],
    ),
    "import": ("a.h5", lambda run, out, rig: ["import", rig, "--rig", rig, "--out", out / "a.h5"]),
    "simulate": ("s.h5", lambda run, out, rig: ["simulate", rig, "--level", "L1", "--out", out / "s.h5"]),
    "templates": ("fr1.toml", lambda run, out, rig: ["config", "templates", out]),
    "starter": ("m.py", lambda run, out, rig: ["gap", "starter", out / "m.py"]),
    "diagnose": ("d.json", lambda run, out, rig: ["gap", "diagnose", run, "--json", out / "d.json"]),
    "score": (
        "s.html",
        lambda run, out, rig: ["gap", "blind", "score", run.parent, "--html", out / "s.html"],
    ),
    "recorder keys": ("recorder.key", lambda run, out, rig: ["keys", "recorder", out]),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_file_that_is_there_stays_as_it_is(run: Path, configs: Path, tmp_path: Path, name: str) -> None:
    out = tmp_path / "out"
    out.mkdir()
    there, command = COMMANDS[name]
    (out / there).write_bytes(OLD)
    before = contents(tmp_path)
    done = CliRunner().invoke(build_app(), list(map(str, command(run, out, configs / "fr1.toml"))))
    assert done.exit_code == 2, done.output
    assert done.exception is None or isinstance(done.exception, SystemExit)
    assert contents(tmp_path) == before


@contextlib.contextmanager
def limited(kind: str, size: int) -> Iterator[None]:
    """The system refuses what goes beyond, as a full disk or a full table of open files does."""
    import resource

    which = getattr(resource, kind)
    soft, hard = resource.getrlimit(which)
    resource.setrlimit(which, (size, hard))
    # Python keeps byte code that the limit cuts short, and then no program can import that module any more.
    sys.dont_write_bytecode = True
    try:
        yield
    finally:
        sys.dont_write_bytecode = False
        resource.setrlimit(which, (soft, hard))


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limit")
@pytest.mark.parametrize("name", ["export", "starter", "templates", "verdict"])
def test_a_disk_that_refuses_leaves_nothing_new_and_nothing_changed(
    run: Path, configs: Path, tmp_path: Path, name: str
) -> None:
    out = tmp_path / "out"
    commands: dict[str, Command] = {
        **{key: command for key, (_, command) in COMMANDS.items()},
        "verdict": lambda run, out, rig: ["campaign", "verdict", run, "bad", "--reason", "long " * 100],
    }
    out.mkdir()
    assert CliRunner().invoke(build_app(), ["campaign", "verdict", str(run), "good"]).exit_code == 0
    before = contents(tmp_path)
    arguments = list(map(str, commands[name](run, out, configs / "fr1.toml")))
    with limited("RLIMIT_FSIZE", 200):
        done = CliRunner().invoke(build_app(), arguments)
    assert done.exit_code == 2, done.output
    assert contents(tmp_path) == before


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limit")
def test_without_a_free_descriptor_a_run_is_told_to_be_unreadable_and_is_readable_again(run: Path) -> None:
    free = os.dup(0)
    os.close(free)
    with limited("RLIMIT_NOFILE", free):
        with pytest.raises(RunFileError):
            open_run(run)
        assert not verify(run).ok
    assert verify(run).ok

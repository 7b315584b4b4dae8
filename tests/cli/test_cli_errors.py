"""Every known failure becomes a paragraph on stderr and its exit code; a bug stays a traceback."""

from __future__ import annotations

import errno

import pytest
import typer

from daq_app.cli.errors import reported
from daq_app.config import ConfigError, Problem
from daq_app.runfile.errors import RunFileError
from drivers.protocol import DriverError

CASES = [
    (
        ConfigError([Problem("a.toml", "key [b]", "is wrong", "Mend it")]),
        2,
        "a.toml: key [b]: is wrong. Mend it",
    ),
    (RunFileError("a.h5 is cut short", advice="Recover it."), 2, "a.h5 is cut short. Recover it."),
    (DriverError("no such device", advice="Plug it in.", code=-200220), 3, "(NI-DAQmx -200220). Plug it in."),
    (PermissionError(errno.EACCES, "Permission denied", "x.json"), 2, "x.json: Permission denied"),
    (KeyboardInterrupt(), 130, "stopped at your request"),
    (BrokenPipeError(), 0, ""),
]


@pytest.mark.parametrize(("error", "code", "words"), CASES, ids=[type(case[0]).__name__ for case in CASES])
def test_failure_is_told(
    error: BaseException, code: int, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(typer.Exit) as caught, reported():
        raise error
    assert caught.value.exit_code == code
    told = capsys.readouterr()
    assert words in told.err
    assert told.out == ""


def test_each_problem_is_a_paragraph_and_they_are_counted(capsys: pytest.CaptureFixture[str]) -> None:
    problems = [Problem("a.toml", f"key{n}", "is wrong", "Mend it") for n in range(3)]
    with pytest.raises(typer.Exit), reported():
        raise ConfigError(problems)
    lines = capsys.readouterr().err.splitlines()
    assert [line[:6] for line in lines[:3]] == ["Error:"] * 3
    assert "3 in all" in lines[3]


def test_a_bug_is_not_hidden() -> None:
    with pytest.raises(ZeroDivisionError), reported():
        raise ZeroDivisionError

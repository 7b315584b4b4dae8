"""Output never decides over a command: any code page, a pipe that closes, a disk that is full."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from daq_app.streams import ForgivingStream


def _daq_app(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-c", "from daq_app.cli import main; main()", *arguments]
    environment = {**os.environ, "PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0"}
    return subprocess.run(command, cwd=cwd, capture_output=True, env=environment, check=False)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--help"], "θ"),
        (["config", "show", "configs/fr1.toml"], "α"),
        (["theory", "--rig", "configs/fr1.toml"], "α"),
        (["gap", "effects"], "θ"),
        (["campaign", "plan"], "FR1"),
    ],
)
def test_every_letter_goes_through_a_pipe_of_any_code_page(
    arguments: list[str], words: str, repository: Path
) -> None:
    done = _daq_app(*arguments, cwd=repository)
    assert done.returncode == 0, done.stderr.decode("utf-8", "replace")
    assert words in done.stdout.decode("utf-8")


class _Broken(io.StringIO):
    def __init__(self) -> None:
        super().__init__()
        self.tries = 0

    def write(self, text: str) -> int:
        self.tries += 1
        raise BrokenPipeError(32, "Broken pipe")


def test_a_stream_whose_reader_has_gone_is_silent_and_not_tried_again() -> None:
    broken = _Broken()
    stream = ForgivingStream(broken)
    for _ in range(3):
        assert stream.write("θ") == 1
        stream.flush()
    assert broken.tries == 1
    assert not stream.isatty()


def test_a_program_without_streams_writes_into_nothing() -> None:
    assert ForgivingStream(None).write("said to nobody") == 14

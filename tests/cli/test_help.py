"""Help: quick, complete, with an example at every command."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
from typer.testing import CliRunner

from daq_app.cli.app import COMMANDS, LazyCommands, build_app, load_command

NAMES = LazyCommands(name="daq-app").list_commands(None)


def _commands(path: str, command: Any) -> Iterator[tuple[str, Any]]:
    inner = getattr(command, "commands", {})
    if not inner:
        yield path, command
    for name, below in inner.items():
        yield from _commands(f"{path} {name}", below)


@pytest.mark.parametrize("name", NAMES)
def test_the_list_of_commands_is_true_and_each_shows_an_example(name: str) -> None:
    command = load_command(name)
    listed = LazyCommands(name="daq-app").get_command(None, name)
    assert " ".join(command.help.split("\n\n")[0].split()) == listed.help
    for path, leaf in _commands(f"daq-app {name}", command):
        assert leaf.help, path
        assert f"Example: {path} " in leaf.epilog, path


def test_help_loads_no_numerical_library_and_no_rich_text() -> None:
    heavy = ("numpy", "scipy", "h5py", "pydantic", "matplotlib", "nidaqmx", "PySide6", "rich")
    code = (
        "import sys; from typer.testing import CliRunner; from daq_app.cli.app import build_app\n"
        "answer = CliRunner().invoke(build_app(), ['--help']); assert answer.exit_code == 0\n"
        f"print([name for name in {heavy!r} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("group", [[], ["gap"], ["gap", "blind"], ["campaign"]])
def test_a_group_shows_the_whole_first_sentence_of_each_command(group: list[str]) -> None:
    page = CliRunner().invoke(build_app(), [*group, "--help"]).stdout
    listed = page.partition("Commands:")[2]
    assert listed
    assert "..." not in listed


def test_help_lists_every_command_and_an_unknown_one_is_told() -> None:
    page = CliRunner().invoke(build_app(), ["--help"]).stdout
    for name in NAMES:
        assert f" {name} " in page
    wrong = CliRunner().invoke(build_app(), ["analyze"])
    assert wrong.exit_code == 2
    assert "No such command" in wrong.stderr


def _modules_after(code: str) -> set[str]:
    code += "\nimport sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_processes_that_draw_load_nothing_that_reads_runs() -> None:
    """They are awaited: the report's first figure begins when their modules are there."""
    preloads = COMMANDS["campaign"].preloads[("report",)]
    loaded = _modules_after("\n".join(f"import daq_app.{module}" for module in preloads))
    assert {
        "matplotlib.figure",
        "matplotlib.backends.backend_pdf",
        "matplotlib.backends.backend_svg",
    } <= loaded
    assert not {"h5py", "pydantic", "psutil", "scipy.special", "jinja2"} & loaded


_DRAWING, _ANALYSIS = "daq_app.campaign.report.drawing", "daq_app.rocking.analysis.analyse"


@pytest.mark.parametrize(
    ("arguments", "begun"),
    [
        (["report", "no-such-folder"], {_DRAWING}),
        (["report", "no-such-folder", "--anew"], {_DRAWING, _ANALYSIS}),
        (["report", "--anew", "--help"], set()),
        (["status", "no-such-folder", "--anew"], set()),
    ],
)
def test_a_report_begins_its_processes_early(
    monkeypatch: pytest.MonkeyPatch, arguments: list[str], begun: set[str]
) -> None:
    warmed: list[str] = []
    monkeypatch.setattr("daq_app.workers.warm_up", lambda *modules: warmed.extend(modules))
    CliRunner().invoke(build_app(), ["campaign", *arguments])
    assert {_DRAWING, _ANALYSIS} & {*warmed} == begun

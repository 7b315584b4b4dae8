"""What an acquisition process refuses, in words: folder or hardware in use, wrong module, options."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from daq_app.acquisition import AcquisitionDied, AcquisitionProcess
from daq_app.acquisition.messages.published import State
from daq_app.acquisition.process.process import main
from daq_app.acquisition.process.simulated import SimulatedServer
from daq_app.runfile import FolderLock
from sim_hardware.control import SimControl
from tests.support.recorder.process_bench import Running


def test_two_recorders_never_share_a_folder(
    start: Callable[..., Running], configs: Path, server: SimulatedServer, tmp_path: Path
) -> None:
    running = start()
    with pytest.raises(AcquisitionDied) as died:
        AcquisitionProcess(
            [
                "--rig",
                str(configs / "fr1.toml"),
                "--out",
                str(tmp_path / "runs"),
                "--connection",
                server.connection,
            ]
        )
    assert died.value.exit_code == 2
    assert "in use by another recorder" in died.value.said and str(running.process.pid) in died.value.said
    assert running.end() == 0


def test_hardware_that_another_recorder_holds(
    start: Callable[..., Running], configs: Path, server: SimulatedServer, tmp_path: Path
) -> None:
    running = start()
    running.wait_for_state(State.PREVIEWING)
    other = AcquisitionProcess(
        [
            *("--rig", str(configs / "fr1.toml"), "--out", str(tmp_path / "other"), "--test", "FR1-L3-1"),
            *("--connection", server.connection),
        ]
    )
    assert other.wait(60) == 3
    assert "reserved by another program" in other.said and "Close the other program" in other.said
    assert running.end() == 0


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ({"kind": "module_removed", "target": "cDAQ1Mod2"}, "cDAQ1Mod2"),
        ({"kind": "reserved", "target": "cDAQ1Mod1"}, "reserved by another program"),
    ],
)
def test_hardware_that_cannot_be_opened_is_told_and_the_process_waits(
    start: Callable[..., Running], wall: SimControl, fault: dict[str, str], words: str
) -> None:
    wall.command("fault", **fault)
    running = start()
    assert words in running.wait_for_state(State.FAILED).text
    wall.command("clear_faults")
    assert running.client.request("preview").ok
    running.wait_for_state(State.PREVIEWING)
    assert running.end() == 0


def test_the_wrong_module_in_a_slot_is_told_and_nothing_is_armed(
    start: Callable[..., Running], wall: SimControl
) -> None:
    wall.command("fault", kind="wrong_device", target="cDAQ1Mod4", product="NI 9201")
    running = start()
    said = running.wait_for_state(State.FAILED).text
    assert "cDAQ1Mod4 is a NI 9201" in said and "put the right module into slot 4" in said
    assert not running.client.request("arm", test="FR1-L3-1").ok
    assert running.end() == 0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--rig", "nowhere.toml"], "nowhere.toml"),
        (["--connection", "usb"], "no way to the hardware"),
        (["--connection", "replay:nowhere.h5"], "nowhere.h5"),
        (["--bind", "tcp://0.0.0.0:0"], "keys"),
        (["--bind", "tcp://127.0.0.1:70000"], "Cannot listen"),
        (["--out", "{file}"], "Choose a folder"),
    ],
)
def test_bad_options_end_with_one_paragraph_and_no_traceback(
    configs: Path, tmp_path: Path, options: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("no folder")
    given = ["--rig", str(configs / "fr1.toml"), "--connection", "grpc://127.0.0.1:1", "--out", str(tmp_path)]
    code = main([*given, *(option.format(file=tmp_path / "file") for option in options)])
    assert code in (2, 3)
    said = capsys.readouterr().err
    assert words in said and len(said.strip().splitlines()) == 1


def test_the_session_file_is_for_its_owner_only(start: Callable[..., Running]) -> None:
    running = start()
    path = running.out / ".acquisition.json"
    if sys.platform != "win32":
        assert path.stat().st_mode & 0o077 == 0
    assert json.loads(path.read_text(encoding="utf-8"))["token"]
    assert running.end() == 0
    with FolderLock(running.out):
        pass

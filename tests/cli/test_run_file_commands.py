"""`daq-app verify`, `recover`, `export` as an operator or a script meets them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from daq_app.cli.runs import commands as run_commands
from daq_app.cli.runs import import_command
from daq_app.runfile import JournalWriter, RunHeader

HEADER = RunHeader(run_id="r", test="FR1-L1-1", channel_ids=("a",), reading_units=("V",), rate_hz=100.0)


@pytest.fixture
def app() -> typer.Typer:
    root = typer.Typer()
    run_commands.register(root)
    import_command.register(root)
    return root


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    with JournalWriter(tmp_path / "FR1-L1-1.journal", HEADER) as writer:
        writer.append_block(0, np.ones((1, 50)))
        writer.append_gap(50, 7, "cable [out]")
        writer.append_block(57, np.ones((1, 50)))
    return tmp_path


def test_recover_then_verify(app: typer.Typer, folder: Path) -> None:
    cli = CliRunner()
    before = cli.invoke(app, ["verify", str(folder)])
    assert before.exit_code == 1 and "daq-app recover" in before.stdout
    made = cli.invoke(app, ["recover", str(folder)])
    assert made.exit_code == 0 and "107 samples per channel, 7 of them missing" in made.stdout
    again = cli.invoke(app, ["recover", str(folder), "--json"])
    assert json.loads(again.stdout)[0]["outcome"] == "saved already"
    after = cli.invoke(app, ["verify", str(folder), "--json"])
    (report,) = json.loads(after.stdout)
    assert after.exit_code == 0 and report["ok"] and report["lost_samples"] == 7


def test_verify_finds_a_changed_byte_and_fails(app: typer.Typer, folder: Path) -> None:
    path = folder / "FR1-L1-1.journal"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    result = CliRunner().invoke(app, ["verify", str(path)])
    assert result.exit_code == 1 and "damaged" in result.stdout


def test_recover_reports_what_is_no_journal(app: typer.Typer, tmp_path: Path) -> None:
    (tmp_path / "x.journal").write_bytes(b"not a journal")
    result = CliRunner().invoke(app, ["recover", str(tmp_path)])
    assert result.exit_code == 1 and "Not recovered" in result.stderr and "Traceback" not in result.output


@pytest.mark.parametrize("command", [["verify"], ["recover"], ["export", "--format", "csv"]])
def test_a_missing_path_is_bad_input(app: typer.Typer, tmp_path: Path, command: list[str]) -> None:
    result = CliRunner().invoke(app, [*command, str(tmp_path / "nowhere.h5")])
    assert result.exit_code == 2 and "nowhere.h5" in result.stderr


def test_export_writes_what_was_asked(app: typer.Typer, folder: Path) -> None:
    cli = CliRunner()
    cli.invoke(app, ["recover", str(folder)])
    run = str(folder / "FR1-L1-1.h5")
    refused = cli.invoke(app, ["export", run, "--format", "npz", "--out", str(folder)])
    assert refused.exit_code == 2 and "--raw" in refused.stderr
    options = ["--format", "npz", "--raw", "--from", "0.1", "--to", "0.2", "--out", str(folder)]
    done = cli.invoke(app, ["export", run, *options])
    assert done.exit_code == 0, done.output
    assert done.stderr == "", "a bar is for a terminal"
    with np.load(folder / "FR1-L1-1.npz") as content:
        assert content["data"].shape == (1, 10)
    again = cli.invoke(app, ["export", run, *options])
    assert again.exit_code == 2 and "--overwrite" in again.stderr
    assert cli.invoke(app, ["export", run, *options, "--overwrite"]).exit_code == 0
    assert cli.invoke(app, ["export", run, "--format", "xls"]).exit_code == 2
    new = folder / "exported" / "today"
    assert cli.invoke(app, ["export", run, "--format", "npz", "--out", str(new)]).exit_code == 2
    assert not new.exists(), "nothing is left of an export that is refused"
    assert cli.invoke(app, ["export", run, "--format", "npz", "--raw", "--out", str(new)]).exit_code == 0
    assert (new / "FR1-L1-1.npz").is_file(), "a name without a suffix is a folder"


def test_import_reports_doubts_and_faults(app: typer.Typer, tmp_path: Path, configs: Path) -> None:
    cli = CliRunner()
    (tmp_path / "old.csv").write_text("t,K1 (V),K2\n0,0.1,5\n0.01,0.2,5\n0.02,0.3,5\n")
    (tmp_path / "map.toml").write_text(
        '[run]\ntest = "FR1-L1-4"\n[channels.WP-1]\nfrom = "K1"\n[channels.AC-1]\nfrom = "K2"\nunit = "V"\n'
    )
    common = ["import", str(tmp_path / "old.csv"), "--rig", str(configs / "fr1.toml"), "--out", str(tmp_path)]
    refused = cli.invoke(app, common)
    assert refused.exit_code == 2 and "'K1', 'K2'" in refused.stderr and "Traceback" not in refused.output
    done = cli.invoke(app, [*common, "--map", str(tmp_path / "map.toml")])
    assert done.exit_code == 0, done.output
    assert "AC-1 never changes" in done.stderr and "2 channels, 3 samples at 100 Hz" in done.stdout
    assert cli.invoke(app, ["verify", str(tmp_path / "FR1-L1-4.h5")]).exit_code == 0
    again = cli.invoke(app, [*common, "--map", str(tmp_path / "map.toml")])
    assert again.exit_code == 2 and "exists already" in again.stderr
    (tmp_path / "map.toml").write_text("[chanels.WP-1]\nfrom = 'K1'\n")
    wrong = cli.invoke(app, [*common, "--map", str(tmp_path / "map.toml")])
    assert wrong.exit_code == 2 and "channels" in wrong.stderr

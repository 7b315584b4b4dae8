"""`daq-app analyse` and `daq-app theory` as an operator meets them."""

from __future__ import annotations

import csv
import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from daq_app.cli.app import build_app
from daq_app.config import plan_tasks
from daq_app.runfile import JournalWriter, RunHeader, finalise, plan_to_dict

RUNNER = CliRunner()


def call(*arguments):
    return RUNNER.invoke(build_app(), [str(argument) for argument in arguments])


def write_run(folder, test, rig_text, stop_s=None):
    rig = test.rig
    header = RunHeader(
        run_id="demo",
        test="FR1-L3-2",
        rig_name=rig.name,
        rig_text=rig_text,
        channel_ids=rig.channel_ids,
        reading_units=tuple(channel.reading_unit for channel in rig.channels),
        rate_hz=test.rate_hz,
        plan=plan_to_dict(plan_tasks(rig)),
        tare={channel.id: 0.0 for channel in rig.channels},
    )
    stop = test.n_samples if stop_s is None else round(stop_s * test.rate_hz)
    with JournalWriter(folder / "demo.journal", header) as journal:
        for start in range(0, stop, 4000):
            journal.append_block(
                start, np.ascontiguousarray(test.readings[:, start : min(start + 4000, stop)])
            )
    return finalise(folder / "demo.journal", folder / "FR1-L3-2.h5")


@pytest.fixture(scope="module")
def rig_text(configs):
    return (configs / "fr1.toml").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def run(made, rig_text, tmp_path_factory):
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    return write_run(tmp_path_factory.mktemp("runs"), test, rig_text)


def test_no_number_is_parted_from_its_error_in_a_pipe_and_no_error_is_zero(run):
    result = call("analyse", run, "--bias-runs", 0)
    assert result.exit_code == 0, result.output
    assert not [line for line in result.output.splitlines() if re.search(r"[±…]\s*│|± 0\.0+│", line)]


def test_analyse_prints_the_table_of_results(run):
    result = call("analyse", run, "--bias-runs", 2)
    assert result.exit_code == 0, result.output
    for words in (
        "θ0/α = 0.3",
        "towards −x",
        "EAV (4.4)",
        "CRT (4.5)",
        "0.895",
        "r_max = 0.9317",
        "as the paper",
    ):
        assert words in result.output


def test_bias_over_the_whole_chain_is_told_when_asked_for(run):
    result = call("analyse", run, "--json", "--bias-runs", 0, "--chain-runs", 2)
    bias = json.loads(result.stdout)["bias"]
    assert bias["eav"]["runs"] == 2 and abs(bias["eav"]["mean"]) < 5e-4
    assert abs(bias["crt_lvdts"]["mean"]) < 5e-4
    assert bias["eav_filtered"]["mean"] < -0.003


def test_analyse_json_is_one_document(run):
    result = call("analyse", run, "--json", "--bias-runs", 0)
    found = json.loads(result.stdout)
    assert found["estimates"]["eav"]["r"] == pytest.approx(0.895, abs=0.001)
    assert found["label"] == "FR1-L3-2" and found["bias"] == {}
    # Known skews came from the run's own plan.
    assert found["release_s"] == pytest.approx(4.5, abs=3e-4)


def test_analyse_writes_files_that_open(run, tmp_path):
    out = tmp_path / "new" / "folder"
    result = call("analyse", run, "--out", out, "--bias-runs", 0)
    assert result.exit_code == 0, result.output
    names = {path.name for path in out.iterdir()}
    assert names == {
        f"FR1-L3-2.{end}"
        for end in (
            "analysis.json",
            "half_cycles.csv",
            "restitution.csv",
            "signals.csv",
            "joint.csv",
            "svg",
            "joint.svg",
        )
    }
    profile = np.genfromtxt(out / "FR1-L3-2.joint.csv", delimiter=",", names=True, usecols=(1, 2, 3, 4))
    assert profile.size == 24
    # Leaning to −x the face at +x is open by b sin θ0, the other closed; at the next peak the other way.
    hold, opposite = profile["opening_hold_m"], profile["opening_first_opposite_peak_m"]
    right = profile["x_m"] > 0
    assert hold[right] == pytest.approx(0.651 * np.sin(0.35 * 0.215), rel=0.01)
    assert opposite[~right].min() > 0.02
    assert max(np.abs(hold[~right]).max(), np.abs(opposite[right]).max()) < 1e-4
    with (out / "FR1-L3-2.half_cycles.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert 0 < float(rows[1]["sigma_speed_before_rad_s"]) < 1e-3
    assert float(rows[1]["jump_ratio"]) == pytest.approx(0.895, abs=0.005)
    signals = np.genfromtxt(out / "FR1-L3-2.signals.csv", delimiter=",", names=True)
    assert np.min(signals["rotation_rad"]) == pytest.approx(-0.35 * 0.215, rel=0.01)
    assert "<svg" in (out / "FR1-L3-2.svg").read_text(encoding="utf-8")[:2000]


def test_a_run_without_a_test_fails_with_exit_code_1(made, rig_text, tmp_path):
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    run = write_run(tmp_path, test, rig_text, stop_s=4.0)
    result = call("analyse", run)
    assert result.exit_code == 1
    assert "no release test found" in result.output and "no release follows" in result.output


@pytest.mark.parametrize("kind", ["missing", "not hdf5", "cut short", "folder"])
def test_bad_files_are_one_paragraph_and_exit_code_2(run, tmp_path, kind):
    path = tmp_path / "bad.h5"
    if kind == "not hdf5":
        path.write_text("hello")
    elif kind == "cut short":
        path.write_bytes(run.read_bytes()[:20_000])
    elif kind == "folder":
        path = tmp_path
    result = call("analyse", path)
    assert result.exit_code == 2
    assert "Error" in result.output and "Traceback" not in result.output


@pytest.mark.parametrize(
    ("extra", "words"), [(["--cutoff", "3000"], "cut-off"), (["--rig", "none.toml"], "none.toml")]
)
def test_bad_options_are_told(run, extra, words):
    result = call("analyse", run, *extra)
    assert result.exit_code == 2 and words in result.output


def test_another_rig_than_the_runs_is_told(run, configs):
    quick = ("--bias-runs", 0, "--json")
    other, same = (
        json.loads(call("analyse", run, "--rig", configs / name, *quick).stdout)["notes"]
        for name in ("fr2.toml", "fr1.toml")
    )
    assert any("with the rig fr2 of --rig, which differs from fr1" in note["text"] for note in other)
    assert not any("--rig" in note["text"] for note in same)


def test_an_unwritable_folder_is_told(run, tmp_path):
    (tmp_path / "file").write_text("in the way")
    result = call("analyse", run, "--out", tmp_path / "file", "--bias-runs", 0)
    assert result.exit_code == 2 and "could not be written" in result.output


def test_theory_of_a_rig(configs):
    result = call("theory", "--rig", configs / "fr1.toml", "--r", 0.895, "--json")
    found = json.loads(result.stdout)
    assert found["p_rad_s"] == pytest.approx(2.204, abs=5e-4)
    assert found["r_max"] == pytest.approx(0.9313, abs=5e-5)
    assert found["semi_rigid"]["a_m"] == pytest.approx(0.033, abs=5e-4)
    assert [level["impacts_to_0.005"] for level in found["levels"]][2] == 19
    assert call("theory", "--rig", configs / "fr1.toml").exit_code == 0


def test_theory_of_explicit_values_and_of_a_rectangle():
    explicit = json.loads(
        call(
            "theory", "--weight-kn", 51.3, "--radius", 1.525, "--inertia", 16107, "--alpha", 0.215, "--json"
        ).stdout
    )
    assert explicit["r_max_rectangular"] == pytest.approx(0.9317, abs=5e-5) and explicit["semi_rigid"] is None
    block = json.loads(call("theory", "--weight-kn", 50, "--width", 0.6, "--height", 2.8, "--json").stdout)
    assert block["r_max"] == pytest.approx(block["r_max_rectangular"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--weight-kn", "50"], "--radius, --inertia, --alpha missing"),
        (["--weight-kn", "50", "--width", "0.6"], "needs --weight-kn, --width and --height"),
        (["--weight-kn", "50", "--width", "0.6", "--height", "2", "--alpha", "0.2"], "homogeneous rectangle"),
        (["--weight-kn", "50", "--width", "0.6", "--height", "2.8", "--phi", "1.2"], "amplitude"),
        (["--weight-kn", "50", "--width", "0.6", "--height", "2.8", "--r", "1.2"], "restitution"),
        (["--rig", "nothing.toml"], "nothing.toml"),
    ],
)
def test_theory_refuses_in_words(arguments, words):
    result = call("theory", *arguments)
    assert result.exit_code == 2
    assert words in " ".join(result.output.split()) and "Traceback" not in result.output


@pytest.mark.parametrize("command", ["analyse", "theory"])
def test_help_has_an_example(command):
    result = call(command, "--help")
    assert result.exit_code == 0 and f"daq-app {command}" in result.output

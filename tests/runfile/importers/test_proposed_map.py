"""A map proposed for a file whose columns have other names, and files by the dozen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter
from typer.testing import CliRunner

from daq_app.cli.app import build_app
from daq_app.config import Rig, load_rig
from daq_app.runfile.importers import load_import_map, propose_map

RATE_HZ = 200.0
OF_WALL = ("LV-A01", "LV-B01", "WP-1", "WP-5", "TL-1X")


@pytest.fixture(scope="module")
def rig(configs: Path) -> Rig:
    return load_rig(configs / "fr1.toml")


def _rocking(rig: Rig) -> dict[str, np.ndarray]:
    """mm and mrad at five places of a block that rocks about its edges: decaying half-cycles and rest."""
    t = np.arange(0.0, 12.0, 1.0 / RATE_HZ)
    theta = 0.06 * np.exp(-0.5 * t) * np.cos(5.0 * t)
    half = 0.5 * rig.specimen.base_width_m
    columns = {}
    for name in OF_WALL:
        channel = rig.channel(name)
        x, _, z = channel.position_m
        opening = (half - x) * np.maximum(theta, 0.0) + (half + x) * np.maximum(-theta, 0.0)
        columns[name] = {"lvdt": 1e3 * opening, "wire": 1e3 * z * theta}.get(channel.family, 1e3 * theta)
    return columns


def _tdms(path: Path, columns: dict[str, np.ndarray], names: list[str]) -> Path:
    rng = np.random.default_rng(7)
    channels = []
    for name, (own, values) in zip(names, columns.items(), strict=True):
        unit = "mrad" if own.startswith("TL") else "mm"
        noise = 0.01 * rng.normal(size=values.size)
        properties = {"unit_string": unit, "wf_increment": 1.0 / RATE_HZ}
        channels.append(ChannelObject("data", name, values + noise, properties=properties))
    with TdmsWriter(path) as writer:
        writer.write_segment(channels)
    return path


def test_columns_without_names_are_found_by_unit_and_course(rig: Rig, tmp_path: Path) -> None:
    file = _tdms(
        tmp_path / "old.tdms", _rocking(rig), ["Kanal 9", "Kanal 3", "Kanal 7", "Kanal 1", "Kanal 4"]
    )
    proposal = propose_map(file, rig)
    pairs = {pair.channel_id: pair.column.rpartition("/")[2] for pair in proposal.pairs}
    columns = dict(zip(["Kanal 9", "Kanal 3", "Kanal 7", "Kanal 1", "Kanal 4"], OF_WALL, strict=True))
    families = {columns[name]: rig.channel(key).family for key, name in pairs.items()}
    assert families == {name: rig.channel(name).family for name in OF_WALL}
    faces = {columns[name]: np.sign(rig.channel(key).position_m[0]) for key, name in pairs.items()}
    assert faces["LV-A01"] != faces["LV-B01"], "LVDTs of opposite faces are told apart by their course"


def test_a_proposed_map_is_a_map_that_imports(rig: Rig, configs: Path, tmp_path: Path) -> None:
    file = _tdms(tmp_path / "old.tdms", _rocking(rig), ["lv_a01", "LV B01", "wp1", "WP5", "tl-1x"])
    command = ["import", str(file), "--rig", str(configs / "fr1.toml")]
    said = CliRunner().invoke(build_app(), [*command, "--propose-map"])
    assert said.exit_code == 0, said.output
    map_file = tmp_path / "map.toml"
    map_file.write_text(said.stdout, encoding="utf-8")
    assert set(load_import_map(map_file).channels) == set(OF_WALL)
    assert "check" not in "".join(line for line in said.stdout.splitlines() if line.startswith("["))
    done = CliRunner().invoke(
        build_app(), [*command, "--map", str(map_file), "--out", str(tmp_path / "runs")]
    )
    assert done.exit_code == 0, done.output
    assert (tmp_path / "runs" / "old.h5").is_file()


def test_one_file_that_is_refused_does_not_stop_the_others(rig: Rig, configs: Path, tmp_path: Path) -> None:
    good = [_tdms(tmp_path / f"t{k}.tdms", _rocking(rig), list(OF_WALL)) for k in (1, 2)]
    bad = tmp_path / "bad.tdms"
    bad.write_bytes(b"TDSm and nothing else")
    files = [str(good[0]), str(bad), str(good[1])]
    done = CliRunner().invoke(
        build_app(), ["import", *files, "--rig", str(configs / "fr1.toml"), "--out", str(tmp_path / "runs")]
    )
    assert done.exit_code == 1
    assert sorted(path.name for path in (tmp_path / "runs").iterdir()) == ["t1.h5", "t2.h5"]
    assert "1 of 3 files" in done.stderr


def test_two_files_that_would_become_one_run_are_refused(rig: Rig, configs: Path, tmp_path: Path) -> None:
    first = _tdms(tmp_path / "t1.tdms", _rocking(rig), list(OF_WALL))
    (tmp_path / "again").mkdir()
    second = _tdms(tmp_path / "again" / "T1.tdms", _rocking(rig), list(OF_WALL))
    words = ["import", str(first), str(second), "--rig", str(configs / "fr1.toml")]
    done = CliRunner().invoke(build_app(), [*words, "--out", str(tmp_path / "runs")])
    assert done.exit_code == 2
    assert "would both become" in done.stderr and "two folders" in done.stderr
    assert not (tmp_path / "runs").exists()

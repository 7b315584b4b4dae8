"""The finished run: complete, self-describing, readable by strangers, honest about damage."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zlib
from pathlib import Path

import h5py
import numpy as np
import psutil
import pytest
import xarray as xr

from daq_app.config import Rig, Scaling
from daq_app.runfile import (
    DerivedData,
    DerivedSignal,
    Gap,
    RunFileError,
    RunHeader,
    finalise,
    open_run,
    recover,
    verify,
)
from daq_app.runfile.integrity import saving


@pytest.fixture
def run(tmp_path: Path, make_journal) -> tuple[Path, np.ndarray]:
    readings = make_journal(tmp_path / "run.journal", n_blocks=50, gap_after=30)
    derived = DerivedData(1000, {"rotation": DerivedSignal(np.arange(7.0), "rad", "θ")}, 2, {"r": 0.9})
    return finalise(tmp_path / "run.journal", tmp_path / "run.h5", derived), readings


def test_every_sample_comes_back(run, header: RunHeader, rig: Rig) -> None:
    path, readings = run
    with open_run(path) as opened:
        assert opened.header == header
        assert opened.rig == rig
        assert (opened.first_sample, opened.n_samples, opened.rate_hz) == (1000, readings.shape[1], 4000.0)
        np.testing.assert_array_equal(opened.readings(), readings)
        np.testing.assert_array_equal(opened.readings(["AC-1"], 17, -5), readings[2:3, 17:-5])
        assert opened.gaps == (Gap(1000 + 31 * 400, 150, "the chassis was off the network"),)
        assert opened.events[0].data == {"theta": 0.07}
        np.testing.assert_allclose(opened.time_s(0, 3), [0.25, 0.25025, 0.2505])
        channels = [rig.channel(i) for i in header.channel_ids]
        np.testing.assert_array_equal(opened.si(), Scaling.of(channels, header.tare).to_si(readings))
        derived = opened.derived
        assert derived is not None and derived.results == {"r": 0.9} and derived.step == 2
        np.testing.assert_array_equal(derived.signals["rotation"].values, np.arange(7.0))
        assert opened.results == {"r": 0.9}


_NEVER_CLOSED = """
import sys, threading
from pathlib import Path
from daq_app.runfile import open_run
opened = open_run(Path(sys.argv[1]))
def hold(run=opened):
    threading.Event().wait()
threading.Thread(target=hold, daemon=True).start()
"""


def test_a_program_that_never_closes_a_run_ends_well(run) -> None:
    path, _ = run
    subprocess.run([sys.executable, "-c", _NEVER_CLOSED, str(path)], check=True, timeout=120)


def test_results_of_a_run_without_any(tmp_path: Path, make_journal) -> None:
    make_journal(tmp_path / "a.journal")
    with open_run(finalise(tmp_path / "a.journal", tmp_path / "a.h5")) as opened:
        assert opened.results == {} and opened.derived is None


def test_the_journal_is_kept_unless_told_otherwise(tmp_path: Path, make_journal) -> None:
    make_journal(tmp_path / "a.journal")
    finalise(tmp_path / "a.journal", tmp_path / "a.h5")
    assert (tmp_path / "a.journal").exists()
    finalise(tmp_path / "a.journal", tmp_path / "a.h5", keep_journal=False)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.h5"]


def test_another_run_is_never_overwritten(tmp_path: Path, make_journal) -> None:
    make_journal(tmp_path / "a.journal")
    finalise(tmp_path / "a.journal", tmp_path / "a.h5")
    make_journal(tmp_path / "b.journal", n_blocks=3)
    before = (tmp_path / "a.h5").read_bytes()
    with pytest.raises(RunFileError, match="is another run"):
        finalise(tmp_path / "b.journal", tmp_path / "a.h5")
    assert (tmp_path / "a.h5").read_bytes() == before


@pytest.mark.parametrize("group", [None, "raw", "si", "channels", "events", "gaps", "derived", "checks"])
def test_xarray_opens_every_group(run, group: str | None) -> None:
    with xr.open_dataset(run[0], engine="h5netcdf", group=group) as dataset:
        dataset.load()
        if group in ("raw", "si"):
            assert dataset.sizes == {"time": run[1].shape[1]}
            assert {dataset[name].attrs["units"] for name in dataset.data_vars} <= {"V", "m", "m/s2", "rad"}
            assert all(dataset[name].attrs["long_name"] for name in dataset.data_vars)
            assert dataset["time"].values[0] == 0.25
        if group == "channels":
            assert list(dataset["channel"].values) == ["LV-A01", "WP-1", "AC-1", "TL-1X"]
        if group == "events":
            assert list(dataset["text"].values) == ["armed, θ steady"]


def test_engineering_units_follow_from_the_attributes_alone(run) -> None:
    """A stranger with h5py gets SI from raw by two attributes."""
    with h5py.File(run[0]) as file:
        for name, stored in file["si"].items():
            if name == "time":
                continue
            raw = file["raw"][name]
            si = (raw[:] - raw.attrs["zero_reading"]) * raw.attrs["si_per_reading"]
            np.testing.assert_array_equal(stored[:], si.astype(np.float32))


def test_a_sound_run_verifies(run) -> None:
    report = verify(run[0])
    assert report.ok and report.lost_samples == 150
    assert report.notes == ("150 samples per channel are missing, in 1 gaps",)


def _change(path: Path, dataset: str, index: int, value: float) -> None:
    with h5py.File(path, "r+") as file:
        file[dataset][index] = value


def test_changed_readings_are_found_though_every_checksum_is_right(run, without_seal) -> None:
    without_seal(run[0])
    _change(run[0], "raw/WP-1", 5, 1.5)
    told = pytest.raises(RunFileError, match="WP-1 between samples 1000 and 1010 is damaged")
    with open_run(run[0]) as opened, told:
        opened.readings(["WP-1"], 0, 10)
    with h5py.File(run[0]) as file:
        forged = file["raw/WP-1"]
        crc = zlib.crc32(forged[: forged.chunks[0]].data)
    _change(run[0], "checks/WP-1", 0, crc)
    report = verify(run[0])
    assert not report.ok
    assert any("WP-1 are not the ones that were recorded" in problem for problem in report.problems)


def test_changed_engineering_units_are_found(run, without_seal) -> None:
    without_seal(run[0])
    _change(run[0], "si/AC-1", 5, 1.5)
    assert verify(run[0]).problems == (
        "the engineering units of AC-1 do not follow from readings and scaling",
    )


def test_a_file_cut_short_is_told_and_made_anew_from_its_journal(run) -> None:
    path, readings = run
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size // 2)
    with pytest.raises(RunFileError, match="cut short or damaged"):
        open_run(path)
    assert not verify(path).ok
    (made,) = recover(path.parent)
    assert made.outcome == "recovered" and "set aside" in made.text
    with open_run(path) as opened:
        np.testing.assert_array_equal(opened.readings(), readings)


@pytest.mark.parametrize("sound", [True, False])
def test_a_file_that_was_read_is_let_go(run, sound: bool) -> None:
    """Windows renames and removes no file that is open: not even of a run that could not be read."""
    path, _ = run
    if not sound:
        data = bytearray(path.read_bytes())
        data[2**16 - 1] ^= 1  # of the first block, which no longer has the hash that was sealed
        path.write_bytes(data)
    opened, refused = None, None
    try:
        opened = open_run(path, just_written=True)
        opened.close()
    except RunFileError as error:
        refused = error  # its traceback keeps what was open
    assert (opened is not None, refused is None) == (sound, sound)
    assert str(path.resolve()) not in {file.path for file in psutil.Process().open_files()}


def test_a_flipped_bit_anywhere_never_gives_a_wrong_sample(run) -> None:
    path, readings = run
    sound = path.read_bytes()
    rng = np.random.default_rng(5)
    broken = path.with_name("broken.h5")
    found = 0
    for place in rng.integers(0, len(sound), 40):
        data = bytearray(sound)
        data[place] ^= 1 << int(rng.integers(8))
        broken.write_bytes(data)
        try:
            with open_run(broken) as opened:
                np.testing.assert_array_equal(opened.readings(), readings)
        except RunFileError:
            found += 1
    assert found > 10


def test_recover_is_idempotent_and_tells_each_journal(tmp_path: Path, make_journal) -> None:
    readings = make_journal(tmp_path / "cut.journal", close=False)
    make_journal(tmp_path / "sub.journal", n_blocks=0)
    (tmp_path / "junk.journal").write_bytes(b"no journal at all" * 100)
    outcomes = {r.journal.name: r.outcome for r in recover(tmp_path)}
    assert outcomes == {"cut.journal": "recovered", "junk.journal": "failed", "sub.journal": "empty"}
    before = (tmp_path / "cut.h5").read_bytes()
    assert {r.outcome for r in recover(tmp_path, thorough=True)} == {"saved already", "failed", "empty"}
    assert (tmp_path / "cut.h5").read_bytes() == before
    with open_run(tmp_path / "cut.h5") as opened:
        np.testing.assert_array_equal(opened.readings(), readings)
        assert not opened.attributes.closed_in_good_order
    assert "recovered" in verify(tmp_path / "cut.h5").notes[0]


def test_a_folder_with_an_unsaved_journal_does_not_verify(tmp_path: Path, make_journal) -> None:
    make_journal(tmp_path / "a.journal")
    report = verify(tmp_path)
    assert not report.ok and "daq-app recover" in report.problems[0]
    recover(tmp_path)
    assert verify(tmp_path).ok


def test_no_room_for_the_run_leaves_the_journal(
    tmp_path: Path, make_journal, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_journal(tmp_path / "a.journal")
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage._replace(free=1000))
    with pytest.raises(RunFileError, match="the journal is safe"):
        finalise(tmp_path / "a.journal", tmp_path / "a.h5")
    assert [p.name for p in tmp_path.iterdir()] == ["a.journal"]


@pytest.mark.parametrize("dataset", ["raw/WP-1", "si/AC-1"])
def test_a_disk_that_changes_what_was_written_is_caught_before_the_run_has_its_name(
    tmp_path: Path, make_journal, monkeypatch: pytest.MonkeyPatch, dataset: str
) -> None:
    make_journal(tmp_path / "a.journal")
    real = saving.fsync_file

    def faulty(path: Path) -> None:
        _change(path, dataset, 700, 1.25)
        real(path)

    monkeypatch.setattr(saving, "fsync_file", faulty)
    with pytest.raises(RunFileError, match="differs from what was written"):
        finalise(tmp_path / "a.journal", tmp_path / "a.h5")
    assert [path.name for path in tmp_path.iterdir()] == ["a.journal"]

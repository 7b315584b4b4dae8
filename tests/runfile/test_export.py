"""Every export format, read back by a program that is not ours."""

from __future__ import annotations

import csv
import errno
import json
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import xarray as xr
from nptdms import TdmsFile
from scipy.io import loadmat

from daq_app.config import Rig
from daq_app.runfile import RunFileError, RunHeader, finalise, open_run
from daq_app.runfile.exporters import FORMATS, export_run, selection
from daq_app.runfile.importers import import_file

Read = tuple[np.ndarray, dict[str, np.ndarray], dict[str, str]]
"""Times, channels, units."""


def read_csv(path: Path) -> Read:
    units = {}
    lines = path.read_text(encoding="utf-8").splitlines()
    for line in lines:
        if line.startswith("# channel "):
            name, _, rest = line.removeprefix("# channel ").partition(" [")
            units[name] = rest.partition("]")[0]
    names, *rows = csv.reader(line for line in lines if not line.startswith("#"))
    table = np.array(rows, dtype=float).T
    return table[0], dict(zip(names[1:], table[1:], strict=True)), units


def read_mat(path: Path) -> Read:
    content = loadmat(path, simplify_cells=True)
    channels = {c["id"]: content[c["variable"]] for c in content["channels"]}
    assert content["run"]["test"] == "FR1-L3-2"
    return content["time_s"], channels, {c["id"]: c["unit"] for c in content["channels"]}


def read_tdms(path: Path) -> Read:
    content = TdmsFile.read(path)
    channels = {channel.name: channel[:] for channel in content["Measurement"].channels()}
    first = content["Measurement"].channels()[0]
    units = {c.name: c.properties["unit_string"] for c in content["Measurement"].channels()}
    return first.time_track(), channels, units


def read_parquet(path: Path) -> Read:
    table = pq.read_table(path)
    units = {name: table.schema.field(name).metadata[b"unit"].decode() for name in table.column_names[1:]}
    channels = {name: table[name].to_numpy() for name in table.column_names[1:]}
    assert json.loads(table.schema.metadata[b"test"]) == "FR1-L3-2"
    return table["time_s"].to_numpy(), channels, units


_NOT_CF = {"m s-2": "m/s2"}


def read_netcdf(path: Path) -> Read:
    with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as content:
        names = {name: str(content[name].attrs["channel"]) for name in content.data_vars}
        channels = {names[name]: content[name].values for name in content.data_vars}
        units = {names[name]: _NOT_CF.get(u := content[name].attrs["units"], u) for name in content.data_vars}
        return content["time"].values, channels, units


def read_npz(path: Path) -> Read:
    with np.load(path, allow_pickle=False) as content:
        names = [str(name) for name in content["names"]]
        times = (content["first_sample"] + np.arange(content["data"].shape[1])) / content["fs"]
        units = dict(zip(names, map(str, content["units"]), strict=True))
        return times, dict(zip(names, content["data"], strict=True)), units


READERS = {
    "csv": read_csv,
    "mat": read_mat,
    "tdms": read_tdms,
    "parquet": read_parquet,
    "netcdf": read_netcdf,
    "npz": read_npz,
}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, header: RunHeader) -> Path:
    from daq_app.runfile import JournalWriter

    folder = tmp_path_factory.mktemp("runs")
    rng = np.random.default_rng(8)
    with JournalWriter(folder / "FR1-L3-2.journal", header) as writer:
        writer.append_block(1000, rng.normal(size=(4, 900)))
        writer.append_gap(1900, 100, "cable [unplugged]")
        writer.append_block(2000, rng.normal(size=(4, 1000)))
        writer.append_event("marker", 2100, "hit, by θ")
    return finalise(folder / "FR1-L3-2.journal", folder / "FR1-L3-2.h5")


@pytest.fixture(autouse=True)
def small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pieces that do not fit the run evenly, so that their seams are in the test."""
    monkeypatch.setattr(selection, "PIECE_SAMPLES", 333)


def test_every_format_has_a_reader_here() -> None:
    assert set(READERS) == set(FORMATS)


@pytest.mark.parametrize("format_", FORMATS)
@pytest.mark.parametrize("units", ["raw", "si"])
def test_read_back_bit_for_bit(tmp_path: Path, run: Path, format_: str, units: str) -> None:
    path = export_run(run, tmp_path, format_, units=units)
    assert path.parent == tmp_path and path.stem == "FR1-L3-2"
    times, channels, channel_units = READERS[format_](path)
    with open_run(run) as source:
        expected = source.readings() if units == "raw" else source.si()
        np.testing.assert_allclose(times, source.time_s(), rtol=0, atol=1e-9)
        assert tuple(channels) == source.channel_ids
        for row, values in zip(expected, channels.values(), strict=True):
            np.testing.assert_array_equal(values, row)
        wanted = source.header.reading_units if units == "raw" else ("m", "m", "m/s2", "rad")
        assert tuple(channel_units.values()) == wanted
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_csv_is_as_exact_without_arrow(tmp_path: Path, run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fast = read_csv(export_run(run, tmp_path / "fast.csv", "csv", units="raw"))[1]
    monkeypatch.setitem(sys.modules, "pyarrow.csv", None)
    slow = read_csv(export_run(run, tmp_path / "slow.csv", "csv", units="raw"))[1]
    for name, values in slow.items():
        np.testing.assert_array_equal(values, fast[name])


@pytest.mark.parametrize("format_", FORMATS)
def test_a_part_of_the_run(tmp_path: Path, run: Path, format_: str) -> None:
    path = export_run(run, tmp_path / f"part{FORMATS[format_]}", format_, from_s=0.3, to_s=0.5)
    times, channels, _ = READERS[format_](path)
    assert times.size == 800 == channels["WP-1"].size
    assert times[0] == pytest.approx(0.3, abs=1e-9) and times[-1] == pytest.approx(0.49975, abs=1e-9)
    with open_run(run) as source:
        np.testing.assert_array_equal(channels["WP-1"], source.si(["WP-1"], 200, 1000)[0])


@pytest.mark.parametrize("format_", ["csv", "mat", "npz", "tdms"])
def test_an_export_comes_back_in_with_its_time(tmp_path: Path, run: Path, rig: Rig, format_: str) -> None:
    """The first row was taken 0.05 s after the run's first sample; to the microsecond of a TDMS stamp."""
    path = export_run(run, tmp_path / f"part{FORMATS[format_]}", format_, units="raw", from_s=0.3, to_s=0.5)
    report = import_file(path, rig, "", tmp_path / "again.h5")
    with open_run(run) as source, open_run(report.run) as again:
        late_ns = again.header.start_utc_ns - source.header.start_utc_ns
        assert late_ns == pytest.approx(50_000_000, abs=1000)
        assert again.rate_hz == source.rate_hz
        part = source.readings(["WP-1", "AC-1"], 200, 1000)
        np.testing.assert_allclose(again.readings(["WP-1", "AC-1"]), part, rtol=1e-12)
    assert not any("when it was recorded" in doubt for doubt in report.doubts)


def test_times_outside_the_run_are_told(tmp_path: Path, run: Path) -> None:
    with pytest.raises(RunFileError, match=r"from 0\.25 s to 0\.75 s"):
        export_run(run, tmp_path, "npz", from_s=5)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("format_", FORMATS)
def test_nothing_is_left_of_an_export_that_fails(
    tmp_path: Path, run: Path, format_: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The third piece cannot be had: the disk is full, or the operator has stopped it."""
    old = tmp_path / f"FR1-L3-2{FORMATS[format_]}"
    old.write_bytes(b"an earlier export")
    real = selection.Selection.values
    for failure, seen in (
        (OSError(errno.ENOSPC, "No space left on device"), RunFileError),
        (KeyboardInterrupt(), KeyboardInterrupt),
    ):
        calls = []

        def values(self, *arguments, calls=calls, failure=failure):
            calls.append(1)
            if len(calls) == 3:
                raise failure
            return real(self, *arguments)

        monkeypatch.setattr(selection.Selection, "values", values)
        with pytest.raises(seen):
            export_run(run, tmp_path, format_, overwrite=True)
        assert [path.name for path in tmp_path.iterdir()] == [old.name]
        assert old.read_bytes() == b"an earlier export"


def test_a_file_that_is_there_is_not_replaced_unasked(tmp_path: Path, run: Path) -> None:
    export_run(run, tmp_path, "npz")
    with pytest.raises(RunFileError, match="exists already"):
        export_run(run, tmp_path, "npz")
    export_run(run, tmp_path, "npz", overwrite=True)


@pytest.mark.parametrize("format_", FORMATS)
@pytest.mark.parametrize("kind", ["missing", "text", "cut short", "no folder"])
def test_bad_input_is_told_and_leaves_nothing(tmp_path: Path, run: Path, format_: str, kind: str) -> None:
    source, out = tmp_path / "bad.h5", tmp_path / "out"
    out.mkdir()
    if kind == "text":
        source.write_text("hello")
    elif kind == "cut short":
        source.write_bytes(run.read_bytes()[:20_000])
    elif kind == "no folder":
        source, out = run, out / "nowhere" / f"x{FORMATS[format_]}"
    with pytest.raises(RunFileError):
        export_run(source, out, format_)
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("name", ["same.h5", "another.h5", "journal.journal"])
def test_a_recording_is_never_replaced(tmp_path: Path, run: Path, name: str) -> None:
    for path in ("same.h5", "another.h5", "journal.journal"):
        (tmp_path / path).write_bytes(run.read_bytes())
    with pytest.raises(RunFileError, match="is a recording"):
        export_run(tmp_path / "same.h5", tmp_path / name, "netcdf", overwrite=True)
    assert (tmp_path / name).read_bytes() == run.read_bytes()


def test_a_run_without_rig_exports_readings_only(tmp_path: Path, header: RunHeader) -> None:
    from daq_app.runfile import JournalWriter

    bare = header.model_copy(update={"rig_text": ""})
    with JournalWriter(tmp_path / "a.journal", bare) as writer:
        writer.append_block(0, np.ones((4, 10)))
    path = finalise(tmp_path / "a.journal", tmp_path / "a.h5")
    with pytest.raises(RunFileError, match="--raw"):
        export_run(path, tmp_path, "csv")
    export_run(path, tmp_path, "csv", units="raw")


def test_channel_names_that_matlab_confuses_stay_apart(tmp_path: Path, header: RunHeader) -> None:
    from daq_app.runfile import JournalWriter

    ids = ("a-b", "a.b", "a_b", "run")
    odd = header.model_copy(update={"channel_ids": ids, "rig_text": "", "tare": {}})
    with JournalWriter(tmp_path / "a.journal", odd) as writer:
        writer.append_block(0, np.arange(8.0).reshape(4, 2))
    path = export_run(finalise(tmp_path / "a.journal", tmp_path / "a.h5"), tmp_path, "mat", units="raw")
    content = loadmat(path, simplify_cells=True)
    for number, known in enumerate(content["channels"]):
        assert known["id"] == ids[number]
        np.testing.assert_array_equal(content[known["variable"]], [2.0 * number, 2.0 * number + 1])


def test_pieces_bound_the_memory(tmp_path: Path, run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No exporter ever asks for more than a piece of all channels at once."""
    largest = 0
    real = selection.Selection.values

    def values(self, ids, start, stop):
        nonlocal largest
        largest = max(largest, stop - start)
        return real(self, ids, start, stop)

    monkeypatch.setattr(selection.Selection, "values", values)
    for format_ in FORMATS:
        export_run(run, tmp_path, format_)
    assert largest == 333

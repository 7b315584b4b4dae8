"""Foreign recordings into runs, whatever the format: maps, doubts, damage, nothing left behind."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from daq_app.config import ConfigError
from daq_app.runfile import RunFileError, finalise, open_run
from daq_app.runfile.exporters import FORMATS, export_run
from daq_app.runfile.importers import load_import_map


@pytest.mark.parametrize("format_", [name for name in FORMATS if name not in ("parquet", "netcdf")])
@pytest.mark.parametrize("units", ["raw", "si"])
def test_own_exports_come_back(tmp_path: Path, make_journal, bring, format_: str, units: str) -> None:
    make_journal(tmp_path / "a.journal", gap_after=3)
    run = finalise(tmp_path / "a.journal", tmp_path / "a.h5")
    exported = export_run(run, tmp_path, format_, units=units)
    report = bring(exported)
    assert report.rate_hz == 4000.0
    with open_run(run) as source, open_run(report.run) as copy:
        assert sorted(copy.channel_ids) == sorted(source.channel_ids)
        ids = source.channel_ids
        if units == "raw":
            np.testing.assert_array_equal(copy.readings(ids), source.readings())
        else:
            np.testing.assert_allclose(copy.si(ids), source.si(), rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("suffix", [".tdms", ".lvm", ".csv", ".mat", ".npz", ".xls", ""])
@pytest.mark.parametrize("content", [b"", b"TDSm", bytes(1000), b"\x89HDF\r\n\x1a\n", b"PK\x03\x04", b"text"])
def test_what_is_no_recording_is_told(tmp_path: Path, bring, suffix: str, content: bytes) -> None:
    path = tmp_path / f"x{suffix}"
    path.write_bytes(content)
    with pytest.raises(RunFileError):
        bring(path)


def test_damaged_files_give_an_error_or_a_run(tmp_path: Path, bring, make_journal) -> None:
    make_journal(tmp_path / "a.journal", n_blocks=2, block=50)
    run = finalise(tmp_path / "a.journal", tmp_path / "a.h5")
    rng = np.random.default_rng(4)
    rows = "".join(f"\t{n / 1000}\t{-n / 1000}\n" for n in range(100))
    lvm = (
        "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tNo\n***End_of_Header***\t\n"
        "Channels\t2\nY_Unit_Label\tVolts\tVolts\nDelta_X\t0.01\t0.01\n***End_of_Header***\t\n"
        f"X_Value\tWP-1\tWP-2\tComment\n{rows}"
    )
    for format_ in ("tdms", "mat", "npz", "csv", "lvm"):
        sound = lvm.encode() if format_ == "lvm" else export_run(run, tmp_path, format_).read_bytes()
        for trial in range(8):
            data = bytearray(sound)
            for place in rng.integers(0, len(data), int(rng.integers(1, 4))):
                data[place] = int(rng.integers(256))
            if trial % 4 == 0:
                del data[int(rng.integers(len(data))) :]
            path = tmp_path / f"{format_}-{trial}.{format_}"
            path.write_bytes(data)
            try:
                bring(path)
            except RunFileError:
                continue


def test_the_map_is_checked_as_a_whole(tmp_path: Path, bring, write_tdms) -> None:
    path = write_tdms(tmp_path / "t.tdms", {"one": np.arange(9.0), "two": np.arange(9.0)}, unit_string="s")
    with pytest.raises(RunFileError) as caught:
        bring(path, {"WP1": "one", "WP-2": "tow", "AC-1": "one", "TL-1X": {"from": "two", "unit": "mm"}})
    for part in ("no channel WP1 (did you mean WP-1?)", "no channel 'tow'", "unit of time", "'mm' cannot be"):
        assert part in str(caught.value)


def test_a_map_file_names_its_faults(tmp_path: Path) -> None:
    path = tmp_path / "map.toml"
    path.write_text('[source]\nrate = 4000\n[channels.WP-1]\nfrom = ""\n')
    with pytest.raises(ConfigError) as caught:
        load_import_map(path)
    assert len(caught.value.problems) == 2
    path.write_text('[run]\ntest = "x"\n[channels.WP-1]\nfrom = "a"\nunit = "V"\n')
    assert load_import_map(path).channels["WP-1"].source == "a"


def test_doubts_about_values(tmp_path: Path, bring, write_tdms) -> None:
    values = {"WP-1": np.zeros(50), "WP-2": np.linspace(0, 900, 50), "AC-1": np.full(50, np.nan)}
    path = write_tdms(tmp_path / "t.tdms", values)
    doubts = "\n".join(bring(path).doubts)
    assert "WP-1 never changes" in doubts and "is V the right unit?" in doubts
    assert "AC-1: 50 of 50 values are missing" in doubts
    with open_run(tmp_path / "runs" / "t.h5") as run:
        assert run.header.origin is not None
        assert "WP-1 never changes" in json.dumps(run.header.origin["doubts"])


@pytest.mark.parametrize("suffix", [".h5", ".journal"])
def test_what_needs_no_import_is_told(tmp_path: Path, bring, suffix: str) -> None:
    with pytest.raises(RunFileError, match="need no import"):
        bring(tmp_path / f"x{suffix}")


def test_an_existing_run_is_never_overwritten(tmp_path: Path, bring, write_tdms) -> None:
    path = write_tdms(tmp_path / "t.tdms", {"WP-1": np.arange(50.0) / 100})
    bring(path)
    with pytest.raises(RunFileError, match="exists already"):
        bring(path)


def test_a_test_name_cannot_lead_out_of_the_folder(tmp_path: Path, bring, write_tdms) -> None:
    path = write_tdms(tmp_path / "t.tdms", {"WP-1": np.arange(50.0) / 100})
    with pytest.raises(RunFileError, match="cannot name a run"):
        bring(path, test="../evil")
    assert not (tmp_path / "evil.h5").exists()

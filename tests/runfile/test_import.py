"""Foreign recordings into runs: values right, lies doubted, damage refused, nothing left behind."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from nptdms.log import log_manager
from scipy.io import savemat

from daq_app.config import ConfigError, Rig
from daq_app.runfile import RunFileError, finalise, open_run, verify
from daq_app.runfile.exporters import FORMATS, export_run
from daq_app.runfile.importers import ImportMap, ImportReport, import_file, load_import_map

LSB = 20 / 65536


@pytest.fixture
def bring(rig: Rig, configs: Path, tmp_path: Path):
    """`bring(path, channels={…}, source={…})` imports into a folder of runs and proves the result."""
    runs = tmp_path / "runs"
    runs.mkdir()
    text = (configs / "fr1.toml").read_text(encoding="utf-8")

    def do(path: Path, channels: dict | None = None, source: dict | None = None, **run) -> ImportReport:
        named = {
            key: {"from": value} if isinstance(value, str) else value
            for key, value in (channels or {}).items()
        }
        import_map = ImportMap.model_validate({"channels": named, "source": source or {}, "run": run})
        before = sorted(runs.iterdir())
        try:
            report = import_file(path, rig, text, runs, import_map)
        except (RunFileError, ConfigError):
            assert sorted(runs.iterdir()) == before, "something was left behind"
            raise
        checked = verify(report.run)
        assert checked.ok, checked.problems
        assert sorted(runs.iterdir()) == sorted([*before, report.run])
        return report

    return do


def si_of(report: ImportReport, channel_id: str) -> np.ndarray:
    with open_run(report.run) as run:
        return run.si([channel_id])[0]


def write_tdms(path: Path, channels: dict[str, np.ndarray], pieces: int = 3, **properties) -> Path:
    known = {"wf_increment": 1 / 4000.0, "unit_string": "V"} | properties
    with TdmsWriter(str(path)) as writer:
        for part in range(pieces):
            objects = [
                ChannelObject("Measurement", name, np.array_split(values, pieces)[part], properties=known)
                for name, values in channels.items()
            ]
            writer.write_segment([RootObject({}), GroupObject("Measurement"), *objects])
    return path


# --- our own exports come back ---------------------------------------------------------------------


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


# --- TDMS ------------------------------------------------------------------------------------------


def test_tdms_volts_are_kept_bit_for_bit(tmp_path: Path, bring) -> None:
    rng = np.random.default_rng(2)
    values = np.round(rng.normal(size=(2, 5000)) / LSB) * LSB
    start = np.datetime64("2024-03-04T09:13:00.123456")
    path = write_tdms(tmp_path / "t.tdms", {"WP-1": values[0], "AC-1": values[1]}, wf_start_time=start)
    report = bring(path)
    with open_run(report.run) as run:
        np.testing.assert_array_equal(run.readings(["WP-1", "AC-1"]), values)
        assert run.header.start_utc_ns == 1709543580123456000
        assert run.header.origin["channels"]["WP-1"]["readings"] == "as in the file"
        assert len(run.header.origin["sha256"]) == 64


def test_tdms_in_one_big_segment_is_read_channel_by_channel(
    tmp_path: Path, bring, monkeypatch: pytest.MonkeyPatch
) -> None:
    from daq_app.runfile.importers import from_tdms

    monkeypatch.setattr(from_tdms, "_WHOLE_CHUNK_BYTES", 1000)
    values = np.arange(4000.0) * 1e-3
    report = bring(write_tdms(tmp_path / "t.tdms", {"WP-1": values, "WP-2": -values}, pieces=2))
    with open_run(report.run) as run:
        np.testing.assert_array_equal(run.readings(["WP-2"])[0], -values)


def test_unequal_channels_are_padded_with_nan_and_doubted(tmp_path: Path, bring) -> None:
    path = write_tdms(tmp_path / "t.tdms", {"WP-1": np.arange(900.0) * 1e-3, "WP-2": np.arange(700.0) * 1e-3})
    report = bring(path)
    assert any("WP-2 has 700 samples where others have 900" in doubt for doubt in report.doubts)
    with open_run(report.run) as run:
        assert np.isnan(run.readings(["WP-2"])[0, 700:]).all() and not run.gaps
        assert [event.kind for event in run.events] == ["short channel"]


def test_tdms_cut_short_keeps_what_is_there_and_says_so(
    tmp_path: Path, bring, monkeypatch: pytest.MonkeyPatch
) -> None:
    printed = io.StringIO()
    monkeypatch.setattr(log_manager.console_handler, "stream", printed)
    values = np.arange(9000.0) * 1e-4
    path = write_tdms(tmp_path / "t.tdms", {"WP-1": values})
    data = path.read_bytes()
    path.write_bytes(data[: len(data) - 10_000])
    report = bring(path)
    assert any("less data than expected" in doubt for doubt in report.doubts)
    with open_run(report.run) as run:
        np.testing.assert_array_equal(run.readings()[0], values[: run.n_samples])
        assert run.n_samples > 6000
    assert printed.getvalue() == ""


def test_real_unscaled_daqmx_data(shared_data: Path, bring) -> None:
    report = bring(
        shared_data / "legacy/raw1.tdms", {"WP-1": "Layer Data/First  Channel", "WP-2": "Seventh Cha"}
    )
    assert (report.rate_hz, report.n_samples) == (50000.0, 2000)
    with open_run(report.run) as run:
        counts = run.readings(["WP-1"])[0] / 0.0003051850947599719
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
        assert counts[0] == pytest.approx(-603)


def test_real_big_endian(shared_data: Path, bring) -> None:
    wanted = {"WP-1": {"from": "Phase sweep", "unit": "V"}}
    report = bring(shared_data / "legacy/big_endian.tdms", wanted)
    with open_run(report.run) as run:
        assert run.readings()[0, 1] == pytest.approx(0.06341759)
    assert any("does not say when" in doubt for doubt in report.doubts)


def test_real_timestamp_of_full_resolution(shared_data: Path, bring) -> None:
    report = bring(shared_data / "legacy/raw_timestamps.tdms", {"WP-1": {"from": "Untitled", "unit": "V"}})
    with open_run(report.run) as run:
        assert run.header.start_utc_ns == 1706060923068614000


def test_real_decimated_copies_are_passed_over(shared_data: Path, bring) -> None:
    path = shared_data / "legacy/Digital_Input.tdms"
    report = bring(path, {"WP-1": {"from": "Dev1_port3_line7", "unit": "V"}})
    assert (report.n_samples, report.rate_hz) == (20000, 2000.0)


def test_independent_recording_reads_the_same_as_tdms_and_npz(shared_data: Path, bring) -> None:
    folder = shared_data / "independent" / "case_001"
    first = bring(folder / "run_01.npz", test="from-npz")
    second = bring(folder / "run_01.tdms", test="from-tdms")
    with np.load(folder / "run_01.npz") as content:
        values = content["data"] * content["scale"][:, None] + content["offset"][:, None]
        factor = {"mm": 1e-3, "m/s2": 1.0, "deg": np.pi / 180}
        si = values * np.array([factor[str(unit)] for unit in content["units"]])[:, None]
        names = [str(name) for name in content["names"]]
    for report in (first, second):
        assert report.rate_hz == 4000.0 and len(report.channel_ids) == 41
        with open_run(report.run) as run:
            np.testing.assert_allclose(run.si(names), si, rtol=1e-12, atol=1e-14)


# --- LVM -------------------------------------------------------------------------------------------


def test_real_decimal_comma(shared_data: Path, bring) -> None:
    for name in ("ladisk_short.lvm", "ladisk_short_new_line_end.lvm"):
        report = bring(shared_data / "legacy" / name, {"AC-1": "Response (Trigger)"})
        assert (report.n_samples, report.rate_hz) == (10, 25600.0)
        np.testing.assert_allclose(si_of(report, "AC-1")[:2], [1.204792, 1.208403], rtol=1e-12)


def test_real_hammer_test(shared_data: Path, bring) -> None:
    path = shared_data / "legacy/ladisk_long_single_header_multi_ch.lvm"
    report = bring(path, {"AC-1": "m_1", "AC-2": "m_2", "AC-3": "F"})
    assert any("1023.02 to 1024.07 Hz" in doubt for doubt in report.doubts)
    assert any("announces 8192 samples and holds 16384" in doubt for doubt in report.doubts)
    assert si_of(report, "AC-2")[2] == pytest.approx(0.246564, abs=1e-12)
    better = bring(path, {"AC-1": "m_1"}, {"rate_hz": 1024}, test="better")
    assert better.rate_hz == 1024.0 and not any("anything from" in doubt for doubt in better.doubts)


def test_real_several_time_columns(shared_data: Path, bring) -> None:
    report = bring(
        shared_data / "legacy/ladisk_multi_time_column.lvm", {"AC-1": "Acceleration", "WP-1": "Voltage"}
    )
    assert report.rate_hz == pytest.approx(51200)
    assert si_of(report, "AC-1")[0] == pytest.approx(0.532608 * 9.80665)
    assert any("announces 51200 samples and holds 3" in doubt for doubt in report.doubts)


def test_real_comments_and_uneven_times(shared_data: Path, bring) -> None:
    path = shared_data / "legacy/ladisk_with_comments.lvm"
    column = {"AC-1": {"from": "Volume (ml)", "unit": "mg"}}
    with pytest.raises(RunFileError, match="not equally spaced"):
        bring(path, column)
    report = bring(path, column, {"rate_hz": 1.0})
    with open_run(report.run) as run:
        assert [event.text for event in run.events][:3] == ["LOST COMMUNICATION", "OK", "LOST COMMUNICATION"]


HRSHM = "legacy/hrshm_ds7_amplitude_5_Impact_0.5_vibration_0.2.lvm"


def test_real_units_that_cannot_be_true_are_not_believed(shared_data: Path, bring) -> None:
    with pytest.raises(RunFileError, match="'s', which is a unit of time"):
        bring(shared_data / HRSHM, {"AC-1": "accelerometer_base", "AC-2": "accelerometer_board"})


def test_real_increments_that_contradict_each_other(shared_data: Path, bring) -> None:
    columns = {
        "AC-1": {"from": "accelerometer_base", "unit": "g"},
        "AC-2": {"from": "excitation_shock", "unit": "g"},
    }
    with pytest.raises(
        RunFileError, match=r"disagree about the time between samples \(0\.000586, 0\.000606 s\)"
    ):
        bring(shared_data / HRSHM, columns)
    report = bring(shared_data / HRSHM, columns, {"time_column": "time"})
    assert report.rate_hz == pytest.approx(1 / 0.000605)
    assert any("every unit in the file is 's'" in doubt for doubt in report.doubts)
    assert any("AC-1 has 12375 samples where others have 13216" in doubt for doubt in report.doubts)
    only = bring(shared_data / HRSHM, {"AC-1": columns["AC-1"]}, test="only")
    assert any("column 'time' says 1652.89 Hz, but 1706.48 Hz was used" in doubt for doubt in only.doubts)


LVM_HEAD = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t,\nMulti_Headings\tYes\nX_Columns\tNo\n"


def lvm_piece(clock: str, rows: list[str], names: str = "WP-1\tWP-2") -> str:
    return (
        "Channels\t2\t\t\nSamples\t3\t3\t\nDate\t2024/01/02\t2024/01/02\t\n"
        f"Time\t{clock}\t{clock}\t\nY_Unit_Label\tVolts\tmV\t\nDelta_X\t0,010000\t0,010000\t\n"
        f"***End_of_Header***\t\t\t\nX_Value\t{names}\tComment\n" + "".join(f"\t{row}\n" for row in rows)
    )


def test_lvm_pieces_empty_fields_and_comments(tmp_path: Path, bring) -> None:
    path = tmp_path / "x.lvm"
    path.write_text(
        LVM_HEAD
        + "***End_of_Header***\t\n\n"
        + lvm_piece("10:00:00,5", ["1,5\t10", "\t20\tdoor", "2,5\t"])
        + "\n"
        + lvm_piece("10:00:01,0", ["3,5\t30", "4,5\t"]),
        encoding="latin-1",
    )
    report = bring(path)
    assert report.rate_hz == 100.0
    with open_run(report.run) as run:
        readings = run.readings(["WP-1", "WP-2"])
        assert [(gap.first_sample, gap.n_samples) for gap in run.gaps] == [(3, 47)]
        np.testing.assert_array_equal(readings[0, [0, 1, 2, 50, 51]], [1.5, np.nan, 2.5, 3.5, 4.5])
        np.testing.assert_allclose(readings[1, [0, 1, 2, 50, 51]], [0.010, 0.020, np.nan, 0.030, np.nan])
        assert [(event.kind, event.sample) for event in run.events] == [("comment", 1), ("short channel", 51)]
    assert any("2 pieces" in doubt for doubt in report.doubts)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("no head at all\n1\t2\n", "is no LVM file"),
        ("LabVIEW Measurement\t\nSeparator\tTab\n", "has no end"),
        (LVM_HEAD + "***End_of_Header***\t\n", "holds no channels"),
        (LVM_HEAD + "***End_of_Header***\t\n" + "Channels\t1\n", "has no end"),
        (LVM_HEAD + "***End_of_Header***\t\n" + lvm_piece("10:00:00", []), "no samples"),
        (
            LVM_HEAD
            + "***End_of_Header***\t\n"
            + lvm_piece("10:00:00", ["1\t2"])
            + lvm_piece("10:00:01", ["1\t2"], names="A\tB"),
            "different channels",
        ),
    ],
)
def test_broken_lvm_is_refused(tmp_path: Path, bring, text: str, why: str) -> None:
    path = tmp_path / "x.lvm"
    path.write_text(text)
    with pytest.raises(RunFileError, match=why):
        bring(path)


# --- CSV -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "time_s,WP-1 (mm),AC-1 [g]\n0,1.5,0.1\n0.01,2.5,0.2\n0.02,3.5,0.3\n",
        "# made by hand\ntime_s;WP-1;AC-1\ns;mm;g\n0,00;1,5;0,1\n0,01;2,5;0,2\n0,02;3,5;0,3\n",
        'time_s\t"WP-1 [mm]"\tAC-1 (g)\n0\t1.5\t"0.1"\n0.01\t2.5\t0.2\n\n0.02\t3.5\t0.3\n',
    ],
)
def test_csv_habits(tmp_path: Path, bring, text: str) -> None:
    path = tmp_path / "x.csv"
    path.write_text(text, encoding="utf-8-sig")
    report = bring(path)
    assert report.rate_hz == pytest.approx(100)
    np.testing.assert_allclose(si_of(report, "WP-1"), [0.0015, 0.0025, 0.0035], rtol=1e-12)
    np.testing.assert_allclose(si_of(report, "AC-1"), np.array([0.1, 0.2, 0.3]) * 9.80665, rtol=1e-12)


def test_csv_with_missing_times_gets_gaps(tmp_path: Path, bring) -> None:
    rows = [row for row in range(100) if row not in (20, 21, 22, 60)]
    path = tmp_path / "x.csv"
    path.write_text("t,WP-1 (V)\n" + "".join(f"{row * 0.25:.2f},{row / 100}\n" for row in rows))
    report = bring(path)
    with open_run(report.run) as run:
        assert run.rate_hz == pytest.approx(4.0)
        assert [(gap.first_sample, gap.n_samples) for gap in run.gaps] == [(20, 3), (60, 1)]
        np.testing.assert_allclose(run.readings()[0, rows], np.array(rows) / 100)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "no row of numbers"),
        ("a,b\nc,d\n", "no row of numbers"),
        ("t,WP-1 (V)\n0,1\n1,2\n1,3\n", "do not increase at row 3"),
        ("t,WP-1 (V)\n0,1\n1,2\n2.6,3\n4,4\n5,5\n", "not equally spaced"),
        ("t,WP-1 (V)\n0,1\n1,2\nx,3\n", "no time in row 3"),
        ("t,WP-1 (kg)\n0,1\n1,2\n", "'kg' cannot be the unit"),
        ("t,WP-1\n0,1\n1,2\n", "no unit"),
        ("t,something\n0,1\n1,2\n", "no channel of the file has the name"),
        ("WP-1 (V)\n1\n2\n", "how fast"),
        ("t,WP-1 (V)\n" + "1" * (2**20 + 5), "more than a million characters"),
        ("t,WP-1 (V)\n0,\0\n", "no text file"),
    ],
)
def test_broken_csv_is_refused(tmp_path: Path, bring, text: str, why: str) -> None:
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(RunFileError, match=why):
        bring(path)


def test_real_encoder_file(shared_data: Path, bring) -> None:
    path = shared_data / "real/free_swing_pendulum/free_swing_01.txt"
    report = bring(
        path,
        {"TL-1X": {"from": "column 1", "unit": "deg"}},
        {"rate_hz": 1000, "skip_lines": 2, "has_names": False},
    )
    assert report.n_samples == len(path.read_text().split("\n")) - 3
    assert any("is deg the right unit?" in doubt for doubt in report.doubts)


# --- MAT and NPZ -----------------------------------------------------------------------------------


def test_real_matlab_file(shared_data: Path, bring) -> None:
    report = bring(shared_data / "real/emps/DATA_EMPS.mat", {"WP-1": {"from": "qm", "unit": "m"}})
    assert (report.n_samples, report.rate_hz) == (24841, pytest.approx(1000))


def test_matlab_73(tmp_path: Path, bring) -> None:
    path = tmp_path / "x.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["WP_1"] = np.arange(50.0)[None, :] / 10
        file["fs"] = np.array([[250.0]])
        file["elsewhere"] = h5py.ExternalLink("secret.h5", "/data")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, made by a test".ljust(128))
    report = bring(path, {"WP-1": {"from": "WP_1", "unit": "V"}})
    assert report.rate_hz == 250.0
    with open_run(report.run) as run:
        np.testing.assert_array_equal(run.readings()[0], np.arange(50.0) / 10)
    with pytest.raises(RunFileError, match="no channel 'elsewhere'"):
        bring(path, {"WP-1": {"from": "elsewhere", "unit": "V"}}, test="other")


def test_matlab_vectors_by_name(tmp_path: Path, bring) -> None:
    savemat(tmp_path / "x.mat", {"WP_1": np.arange(9.0), "fs": 100.0, "text": "hello", "square": np.eye(3)})
    report = bring(tmp_path / "x.mat", {"WP-1": {"from": "WP-1", "unit": "V", "scale": -2, "offset": 1}})
    with open_run(report.run) as run:
        np.testing.assert_array_equal(run.readings()[0], 1 - 2 * np.arange(9.0))


def test_npz_of_single_arrays(tmp_path: Path, bring) -> None:
    np.savez(tmp_path / "x.npz", **{"WP-1": np.arange(9.0), "time": np.arange(9) / 50, "names": ["a"]})
    report = bring(tmp_path / "x.npz", {"WP-1": {"from": "WP-1", "unit": "V"}})
    assert report.rate_hz == pytest.approx(50)


class Bomb:
    def __reduce__(self):
        return (Path("bomb-went-off").touch, ())


def test_npz_pickles_are_never_opened(tmp_path: Path, bring, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    np.savez(tmp_path / "x.npz", data=np.array([Bomb()], dtype=object), **{"WP-1": np.arange(9.0)})
    with pytest.raises(RunFileError):
        bring(tmp_path / "x.npz", {"WP-1": {"from": "data", "unit": "V"}})
    assert not (tmp_path / "bomb-went-off").exists()


def test_npz_that_claims_more_than_it_holds(tmp_path: Path, bring) -> None:
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (41, 2**40)})
    with zipfile.ZipFile(tmp_path / "x.npz", "w") as archive:
        archive.writestr("data.npy", head.getvalue())
    with pytest.raises(RunFileError, match="claims more numbers than it holds"):
        bring(tmp_path / "x.npz")


@pytest.mark.parametrize(("place", "value"), [(4, 255), (6, 1), (8, 99)])
def test_npz_of_a_kind_that_zip_does_not_know(tmp_path: Path, bring, place: int, value: int) -> None:
    """Version, flags and method of the first entry, in the directory at the end."""
    np.savez(tmp_path / "x.npz", **{"WP-1": np.arange(9.0), "fs": 10.0})
    data = bytearray((tmp_path / "x.npz").read_bytes())
    data[data.index(b"PK\x01\x02") + place + 2] = value
    (tmp_path / "x.npz").write_bytes(data)
    with pytest.raises(RunFileError, match=r"x\.npz"):
        bring(tmp_path / "x.npz", {"WP-1": {"from": "WP-1", "unit": "V"}})


# --- any format ------------------------------------------------------------------------------------


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
    for format_ in ("tdms", "mat", "npz", "csv"):
        sound = export_run(run, tmp_path, format_).read_bytes()
        for trial in range(8):
            data = bytearray(sound)
            for place in rng.integers(0, len(data), int(rng.integers(1, 4))):
                data[place] = int(rng.integers(256))
            if trial % 4 == 0:
                del data[int(rng.integers(len(data))) :]
            path = tmp_path / f"{format_}-{trial}{FORMATS[format_]}"
            path.write_bytes(data)
            try:
                bring(path)
            except RunFileError:
                continue


def test_the_map_is_checked_as_a_whole(tmp_path: Path, bring) -> None:
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


def test_doubts_about_values(tmp_path: Path, bring) -> None:
    values = {"WP-1": np.zeros(50), "WP-2": np.linspace(0, 900, 50), "AC-1": np.full(50, np.nan)}
    path = write_tdms(tmp_path / "t.tdms", values)
    doubts = "\n".join(bring(path).doubts)
    assert "WP-1 never changes" in doubts and "is V the right unit?" in doubts
    assert "AC-1: 50 of 50 values are missing" in doubts
    with open_run(tmp_path / "runs" / "t.h5") as run:
        assert run.header.origin is not None
        assert "WP-1 never changes" in json.dumps(run.header.origin["doubts"])


def test_an_existing_run_is_never_overwritten(tmp_path: Path, bring) -> None:
    path = write_tdms(tmp_path / "t.tdms", {"WP-1": np.arange(50.0) / 100})
    bring(path)
    with pytest.raises(RunFileError, match="exists already"):
        bring(path)


def test_a_test_name_cannot_lead_out_of_the_folder(tmp_path: Path, bring) -> None:
    path = write_tdms(tmp_path / "t.tdms", {"WP-1": np.arange(50.0) / 100})
    with pytest.raises(RunFileError, match="cannot name a run"):
        bring(path, test="../evil")
    assert not (tmp_path / "evil.h5").exists()

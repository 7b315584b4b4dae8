"""TDMS into runs: values bit for bit, both byte orders, unscaled DAQmx, damage and lies told."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from nptdms.log import log_manager

from daq_app.runfile import open_run

LSB = 20 / 65536


def test_tdms_volts_are_kept_bit_for_bit(tmp_path: Path, bring, write_tdms) -> None:
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
    tmp_path: Path, bring, write_tdms, monkeypatch: pytest.MonkeyPatch
) -> None:
    from daq_app.runfile.importers.formats import from_tdms

    monkeypatch.setattr(from_tdms, "_WHOLE_CHUNK_BYTES", 1000)
    values = np.arange(4000.0) * 1e-3
    report = bring(write_tdms(tmp_path / "t.tdms", {"WP-1": values, "WP-2": -values}, pieces=2))
    with open_run(report.run) as run:
        np.testing.assert_array_equal(run.readings(["WP-2"])[0], -values)


def test_unequal_channels_are_padded_with_nan_and_doubted(tmp_path: Path, bring, write_tdms) -> None:
    path = write_tdms(tmp_path / "t.tdms", {"WP-1": np.arange(900.0) * 1e-3, "WP-2": np.arange(700.0) * 1e-3})
    report = bring(path)
    assert any("WP-2 has 700 samples where others have 900" in doubt for doubt in report.doubts)
    with open_run(report.run) as run:
        assert np.isnan(run.readings(["WP-2"])[0, 700:]).all() and not run.gaps
        assert [event.kind for event in run.events] == ["short channel"]


def test_tdms_cut_short_keeps_what_is_there_and_says_so(
    tmp_path: Path, bring, write_tdms, monkeypatch: pytest.MonkeyPatch
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

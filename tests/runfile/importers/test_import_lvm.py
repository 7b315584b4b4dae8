"""LVM into runs: its many habits, and what it says that cannot be true."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from daq_app.runfile import RunFileError, open_run


def test_real_decimal_comma(shared_data: Path, bring, si_of) -> None:
    for name in ("ladisk_short.lvm", "ladisk_short_new_line_end.lvm"):
        report = bring(shared_data / "legacy" / name, {"AC-1": "Response (Trigger)"})
        assert (report.n_samples, report.rate_hz) == (10, 25600.0)
        np.testing.assert_allclose(si_of(report, "AC-1")[:2], [1.204792, 1.208403], rtol=1e-12)


def test_real_hammer_test(shared_data: Path, bring, si_of) -> None:
    path = shared_data / "legacy/ladisk_long_single_header_multi_ch.lvm"
    report = bring(path, {"AC-1": "m_1", "AC-2": "m_2", "AC-3": "F"})
    assert any("1023.02 to 1024.07 Hz" in doubt for doubt in report.doubts)
    assert any("announces 8192 samples and holds 16384" in doubt for doubt in report.doubts)
    assert si_of(report, "AC-2")[2] == pytest.approx(0.246564, abs=1e-12)
    better = bring(path, {"AC-1": "m_1"}, {"rate_hz": 1024}, test="better")
    assert better.rate_hz == 1024.0 and not any("anything from" in doubt for doubt in better.doubts)


def test_real_several_time_columns(shared_data: Path, bring, si_of) -> None:
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


def test_decimal_commas_under_a_head_that_says_points_are_believed_and_said(
    tmp_path: Path, bring, si_of
) -> None:
    path = tmp_path / "x.lvm"
    head = LVM_HEAD.replace("Separator\t,", "Separator\t.") + "***End_of_Header***\t\n\n"
    piece = lvm_piece("10:00:00", ["1,5\t10,5", "2,5\t20"]).replace("0,010000", "0.010000")
    path.write_text(head + piece, encoding="latin-1")
    report = bring(path)
    with open_run(report.run) as run:
        np.testing.assert_array_equal(run.readings(["WP-1"])[0], [1.5, 2.5])
    assert report.rate_hz == 100.0
    assert any("decimal commas and its head says '.'" in doubt for doubt in report.doubts)


def test_local_time_without_a_zone_is_doubted_until_the_map_gives_one(tmp_path: Path, bring) -> None:
    path = tmp_path / "x.lvm"
    head = LVM_HEAD + "***End_of_Header***\t\n\n"
    path.write_text(head + lvm_piece("10:00:00", ["1\t1", "2\t2"]), encoding="latin-1")
    assert any("start_utc" in doubt for doubt in bring(path).doubts)
    told = bring(path, source={"start_utc": "2024-01-02T10:00:00+02:00"}, test="told")
    assert not any("start_utc" in doubt for doubt in told.doubts)
    with open_run(told.run) as run:
        assert run.header.start_utc_ns == 1_704_182_400 * 10**9


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

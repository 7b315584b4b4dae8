"""CSV into runs: delimiters, decimal commas, units, columns of times with gaps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from daq_app.runfile import RunFileError, open_run


@pytest.mark.parametrize(
    "text",
    [
        "time_s,WP-1 (mm),AC-1 [g]\n0,1.5,0.1\n0.01,2.5,0.2\n0.02,3.5,0.3\n",
        "# made by hand\ntime_s;WP-1;AC-1\ns;mm;g\n0,00;1,5;0,1\n0,01;2,5;0,2\n0,02;3,5;0,3\n",
        'time_s\t"WP-1 [mm]"\tAC-1 (g)\n0\t1.5\t"0.1"\n0.01\t2.5\t0.2\n\n0.02\t3.5\t0.3\n',
    ],
)
def test_csv_habits(tmp_path: Path, bring, si_of, text: str) -> None:
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


@pytest.mark.parametrize("stamp", ["9999999999999999999", "0", "-5", "1e18", "soon"])
def test_an_impossible_time_of_recording_is_not_believed(tmp_path: Path, bring, stamp: str) -> None:
    path = tmp_path / "x.csv"
    path.write_text(f"# first_row_utc_ns: {stamp}\ntime_s,WP-1 (mm)\n0,1.5\n0.01,2.5\n0.02,3.5\n")
    assert any("when it was recorded" in doubt for doubt in bring(path).doubts)


def test_a_year_that_a_run_cannot_hold_is_not_believed(tmp_path: Path, bring) -> None:
    path = tmp_path / "x.csv"
    path.write_text("time_s,WP-1 (mm)\n0,1.5\n0.01,2.5\n0.02,3.5\n")
    report = bring(path, source={"start_utc": "2400-01-01T00:00:00Z"})
    assert any("after 2262" in doubt for doubt in report.doubts)
    with open_run(report.run) as run:
        assert run.header.start_utc_ns == 0

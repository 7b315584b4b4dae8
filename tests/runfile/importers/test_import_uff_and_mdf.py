"""Universal files and MDF into runs; the files are written by the libraries of others."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import numpy as np
import pytest

from daq_app.runfile import RunFileError, open_run

asammdf = pytest.importorskip("asammdf")
pyuff = pytest.importorskip("pyuff")
T = np.arange(800) / 400.0
WAVE = np.round(5.0 * np.exp(-T) * np.cos(6.0 * T), 6)


def test_a_universal_file_comes_in_by_node_and_direction(tmp_path: Path, bring, si_of) -> None:
    path = tmp_path / "wall.uff"
    sets = [
        pyuff.prepare_58(
            binary=0,
            func_type=kind,
            rsp_node=node,
            rsp_dir=3,
            ref_node=0,
            ref_dir=1,
            id1=f"test {node}",
            ord_data_type=4,
            num_pts=T.size,
            abscissa_spacing=1,
            abscissa_min=0.0,
            abscissa_inc=1.0 / 400.0,
            ordinate_spec_data_type=8,
            orddenom_spec_data_type=0,
            abscissa_spec_data_type=17,
            z_axis_spec_data_type=0,
            ordinate_axis_units_lab="mm",
            data=WAVE * node,
            x=T,
        )
        for node, kind in ((1, 1), (2, 1), (3, 2))
    ]
    pyuff.UFF(str(path)).write_sets(sets, mode="overwrite")
    report = bring(path, {"LV-A01": "node 1 z", "LV-B01": "node 2 z"})
    assert (report.n_samples, report.rate_hz) == (800, pytest.approx(400.0))
    np.testing.assert_allclose(si_of(report, "LV-B01"), 2e-3 * WAVE, atol=1e-8)
    assert any("1 datasets are no time histories" in doubt for doubt in report.doubts)


def test_an_mdf_file_comes_in_with_its_units_and_its_time_of_day(tmp_path: Path, bring, si_of) -> None:
    path = tmp_path / "bench.mf4"
    with asammdf.MDF(version="4.10") as mdf:
        mdf.header.start_time = dt.datetime(2024, 1, 2, 10, 0, tzinfo=dt.timezone(dt.timedelta(hours=2)))
        mdf.append([asammdf.Signal(WAVE, T, name="opening", unit="mm")])
        mdf.append([asammdf.Signal(3 * WAVE, T, name="opening", unit="mm")])
        mdf.save(path)
    report = bring(path, {"LV-A01": "opening", "LV-B01": "group 2/opening"})
    assert report.rate_hz == pytest.approx(400.0)
    np.testing.assert_allclose(si_of(report, "LV-B01"), 3e-3 * WAVE, atol=1e-9)
    with open_run(report.run) as run:
        assert run.header.start_utc_ns == 1_704_182_400 * 10**9


@pytest.mark.parametrize("name", ["broken.uff", "broken.mf4"])
@pytest.mark.parametrize(
    "content", [b"", b"    -1\n    58\nno numbers\n    -1\n", b"MDF     4.10" + bytes(200)]
)
def test_what_is_no_such_file_is_told(tmp_path: Path, bring, name: str, content: bytes) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(RunFileError):
        bring(path, {"LV-A01": "x"})

"""MATLAB and NumPy files into runs; what is dangerous in them is never opened."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from daq_app.runfile import RunFileError, open_run


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


def test_npz_that_unpacks_to_gigabytes_is_refused_by_what_it_claims(
    tmp_path: Path, bring, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "bomb.npz"
    np.savez_compressed(path, **{"WP-1": np.zeros(40_000_000), "rate_hz": 4000.0})

    def unpack(*_: object, **__: object) -> object:
        raise AssertionError("nothing of it is unpacked")

    monkeypatch.setattr(zipfile.ZipFile, "open", unpack)
    with pytest.raises(RunFileError, match=r"claims to unpack from 0\.3 MB to 0\.3 GB"):
        bring(path, {"WP-1": "WP-1"})


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

"""Rotation and r go out with every export, and a program that is not ours reads them back."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
import pytest
import xarray as xr
from nptdms import TdmsFile
from scipy.io import loadmat

from daq_app.campaign.names import level_in
from daq_app.runfile import (
    DerivedData,
    DerivedSignal,
    JournalWriter,
    Run,
    RunHeader,
    TestPlan,
    finalise,
)
from daq_app.runfile.exporters import FORMATS, export_run, selection

ROTATION = np.linspace(-0.07, 0.07, 900)
ANALYSIS = {
    "verdict": {"r": 0.8951, "standard_error": 0.0004, "trust": "good"},
    "estimates": {"eav": {"r": 0.8949, "standard_error": 0.0005}},
    "theta0_by_family": {"wires": {"value": -0.0752, "sigma": 0.0001}},
    "half_cycles": [
        {"n": 0, "start_s": 0.3, "duration_s": 0.25, "peak_rad": -0.0752, "sigma_peak_rad": 1e-4},
        {"n": 1, "start_s": 0.55, "sigma_start_s": 1e-5, "peak_rad": 0.05, "speed_before_rad_s": 0.3},
    ],
}
Read = Callable[[Path], tuple[np.ndarray, float]]


def derive(run: Run) -> DerivedData:
    return DerivedData(
        run.first_sample,
        {"rotation": DerivedSignal(ROTATION, "rad", "rotation of the wall")},
        results={"analysis": ANALYSIS},
    )


def columns_of(path: Path, delimiter: str = ",") -> dict[str, list[str]]:
    """Columns of a CSV by the standard library; lines of metadata left out."""
    with path.open(encoding="utf-8", newline="") as file:
        names, *rows = csv.reader((line for line in file if line[0] != "#"), delimiter=delimiter)
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


def r_of(sources: Iterable[str], quantities: Iterable[str], values: Iterable[float]) -> float:
    rows = zip(sources, quantities, values, strict=True)
    (r,) = (value for source, quantity, value in rows if (source, quantity) == ("verdict: good", "r"))
    return float(r)


def from_csv(path: Path) -> tuple[np.ndarray, float]:
    skip = sum(line.startswith("#") for line in path.read_text(encoding="utf-8").splitlines())
    table = pa_csv.read_csv(path, read_options=pa_csv.ReadOptions(skip_rows=skip))
    tidy = columns_of(beside(path))
    return table["rotation"].to_numpy(), r_of(tidy["source"], tidy["quantity"], map(float, tidy["value"]))


def from_mat(path: Path) -> tuple[np.ndarray, float]:
    content = loadmat(path, simplify_cells=True)
    (r,) = (row["value"] for row in content["results"] if str(row["source"]) == "verdict: good")
    return content["rotation"], r


def from_tdms(path: Path) -> tuple[np.ndarray, float]:
    content = TdmsFile.read(path)
    results = content["Results"]
    return content["Derived"]["rotation"][:], r_of(*(results[n][:] for n in ("source", "quantity", "value")))


def from_parquet(path: Path) -> tuple[np.ndarray, float]:
    table = pq.read_table(path)
    rows = json.loads(table.schema.metadata[b"results"])
    columns = ([row[name] for row in rows] for name in ("source", "quantity", "value"))
    return table["rotation"].to_numpy(), r_of(*columns)


def from_netcdf(path: Path) -> tuple[np.ndarray, float]:
    with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as content:
        columns = (content[f"result_{name}"].values for name in ("source", "quantity", "value"))
        return content["rotation"].values, r_of(*columns)


def from_npz(path: Path) -> tuple[np.ndarray, float]:
    with np.load(path, allow_pickle=False) as content:
        row = list(content["derived_names"]).index("rotation")
        columns = (content[f"results_{name}"] for name in ("source", "quantity", "value"))
        return content["derived"][row], r_of(*columns)


def beside(path: Path) -> Path:
    return path.with_suffix(".results.csv")


READERS: dict[str, Read] = {
    "csv": from_csv,
    "mat": from_mat,
    "tdms": from_tdms,
    "parquet": from_parquet,
    "netcdf": from_netcdf,
    "npz": from_npz,
}


def recorded(folder: Path, header: RunHeader) -> Path:
    journal = folder / "demo.journal"
    with JournalWriter(journal, header) as writer:
        writer.append_block(1000, np.random.default_rng(8).normal(size=(4, 900)))
    return finalise(journal, folder / "FR1-L3-2.h5")


@pytest.fixture
def run(tmp_path: Path, header: RunHeader) -> Path:
    return recorded(tmp_path, header)


@pytest.mark.parametrize("format_", FORMATS)
def test_rotation_and_r_are_read_back(
    tmp_path: Path, run: Path, format_: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(selection, "PIECE_SAMPLES", 333)
    rotation, r = READERS[format_](export_run(run, tmp_path, format_, derive=derive))
    np.testing.assert_array_equal(rotation, ROTATION)
    assert r == 0.8951


def test_the_tidy_table_has_a_row_per_number(tmp_path: Path, run: Path) -> None:
    table = columns_of(beside(export_run(run, tmp_path, "npz", derive=derive)))
    assert list(table) == ["test", "level", "quantity", "source", "n", "value", "sigma", "unit"]
    rows = list(zip(table["quantity"], table["n"], table["value"], table["sigma"], strict=True))
    assert ("peak rotation", "0", "-0.0752", "0.0001") in rows
    assert set(table["test"]) == {"FR1-L3-2"}


@pytest.mark.parametrize(("planned", "told"), [("L2", "L2"), ("", "L3")])
def test_the_tidy_table_has_the_level_of_the_plan_or_of_the_tests_name(
    tmp_path: Path, header: RunHeader, planned: str, told: str
) -> None:
    run = recorded(tmp_path, header.model_copy(update={"test_plan": TestPlan(level=planned)}))
    path = export_run(run, tmp_path, "npz", derive=derive, level_of=level_in)
    assert set(columns_of(beside(path))["level"]) == {told}


def test_decimal_commas_go_with_semicolons(tmp_path: Path, run: Path) -> None:
    path = export_run(run, tmp_path, "csv", derive=derive, decimal="comma")
    rotation = [float(text.replace(",", ".")) for text in columns_of(path, ";")["rotation"]]
    np.testing.assert_array_equal(rotation, ROTATION)
    assert "0,8951" in columns_of(beside(path), ";")["value"]


@pytest.mark.parametrize(("decimal", "separator", "point"), [("point", ",", "."), ("comma", ";", ",")])
def test_pandas_reads_the_tidy_table_of_either_locale(
    tmp_path: Path, run: Path, decimal: str, separator: str, point: str
) -> None:
    path = export_run(run, tmp_path, "csv", derive=derive, decimal=decimal)
    table = pd.read_csv(beside(path), sep=separator, decimal=point)
    (r,) = table[(table["source"] == "verdict: good") & (table["quantity"] == "r")]["value"]
    assert r == 0.8951


def test_the_netcdf_library_reads_rotation_and_r(tmp_path: Path, run: Path) -> None:
    netcdf = pytest.importorskip("netCDF4", reason="Unidata's netCDF4 is not installed")
    with netcdf.Dataset(export_run(run, tmp_path, "netcdf", derive=derive)) as content:
        columns = [content[f"result_{name}"][:].tolist() for name in ("source", "quantity", "value")]
        np.testing.assert_array_equal(content["rotation"][:], ROTATION)
        assert r_of(*columns) == 0.8951


def test_a_part_of_the_run_has_the_rotation_of_that_part(tmp_path: Path, run: Path) -> None:
    path = export_run(run, tmp_path / "part.mat", "mat", from_s=0.3, to_s=0.4, derive=derive)
    content = loadmat(path, simplify_cells=True)
    wanted = np.round(content["time_s"] * 4000).astype(int) - 1000
    np.testing.assert_array_equal(content["rotation"], ROTATION[wanted])


def test_no_data_variable_of_a_netcdf_claims_to_be_an_axis(tmp_path: Path, run: Path) -> None:
    path = export_run(run, tmp_path, "netcdf", derive=derive)
    with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as content:
        for name in content.data_vars:
            assert "axis" not in content[name].attrs
            assert content[name].attrs["long_name"]


@pytest.mark.skipif(shutil.which("octave") is None, reason="GNU Octave is not installed")
def test_octave_reads_rotation_and_r(tmp_path: Path, run: Path) -> None:
    path = export_run(run, tmp_path, "mat", derive=derive)
    program = f"load('{path}'); printf('%.17g %.17g', rotation(end), results(1).value)"
    done = subprocess.run(
        ["octave", "--eval", program], capture_output=True, text=True, check=True, timeout=120
    )
    assert [float(word) for word in done.stdout.split()] == [ROTATION[-1], 0.8951]

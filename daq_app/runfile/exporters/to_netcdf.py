"""netCDF-4 with one time dimension, CF attributes, one variable per channel."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.exporters.selection import PIECE_SAMPLES, Selection
from daq_app.runfile.hdf5.guarded_file import GuardedFile
from daq_app.runfile.layout import CONVENTIONS

_COMPRESSION = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "fletcher32": True}


def write(path: Path, selection: Selection) -> None:
    """Needs the optional package h5netcdf; raises `RunFileError` where it is absent."""
    try:
        import h5netcdf
    except ImportError as error:
        raise RunFileError(
            "netCDF needs the package h5netcdf",
            advice="Install it: pip install rocking-test-recorder[formats].",
        ) from error
    with GuardedFile(path) as guarded:
        with h5netcdf.File(guarded, "w") as file:
            _fill(file, selection, guarded)
        guarded.raise_failure()


def _fill(file: Any, selection: Selection, guarded: GuardedFile) -> None:
    chunks = (min(PIECE_SAMPLES // 4, selection.n_samples),)
    file.attrs["Conventions"] = CONVENTIONS
    for key, value in selection.metadata().items():
        file.attrs[key] = json.dumps(value) if isinstance(value, list) else value
    file.dimensions = {"time": selection.n_samples}
    time = file.create_variable("time", ("time",), "f8", chunks=chunks, **_COMPRESSION)
    time.attrs["units"] = "s"
    variables = []
    for channel_id, unit in zip(selection.ids, selection.channel_units, strict=True):
        variable = file.create_variable(channel_id, ("time",), "f8", chunks=chunks, **_COMPRESSION)
        variable.attrs["units"] = unit
        for key, value in selection.channel_metadata(channel_id).items():
            variable.attrs[key] = np.array(value) if isinstance(value, list) else value
        variables.append(variable)
    at = 0
    for times, values in selection.pieces():
        part = slice(at, at + times.size)
        time[part] = times
        for variable, row in zip(variables, values, strict=True):
            variable[part] = row
        at += times.size
        guarded.raise_failure()

"""netCDF-4 with one time dimension, CF attributes, one variable per channel."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.exporters.selection import PIECE_SAMPLES, Selection
from daq_app.runfile.hdf5.guarded_file import GuardedFile
from daq_app.runfile.layout import CONVENTIONS

_CF_UNITS: Final = {"m/s2": "m s-2", "m/s²": "m s-2", "rad/s": "rad s-1", "rad/m": "rad m-1", "": "1"}
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
    _put_attributes(file, selection)
    file.dimensions = {"time": selection.n_samples}
    time = file.create_variable("time", ("time",), "f8", chunks=chunks, **_COMPRESSION)
    time.attrs.update(_time_attributes(selection))
    variables = _create_channels(file, selection, chunks)
    for column in selection.derived:
        variable = file.create_variable(column.name, ("time",), "f8", chunks=chunks, **_COMPRESSION)
        variable.attrs.update({"long_name": column.long_name, "units": cf_unit(column.unit)})
        variable[...] = column.values
    if selection.results:
        _put_results(file, selection)
    at = 0
    for times, values in selection.pieces():
        part = slice(at, at + times.size)
        time[part] = times
        for variable, row in zip(variables, values, strict=True):
            variable[part] = row
        at += times.size
        guarded.raise_failure()


def _put_attributes(file: Any, selection: Selection) -> None:
    """Attributes of the whole file."""
    header = selection.run.header
    if header.start_utc_ns:
        file.attrs["Conventions"] = CONVENTIONS  # CF wants dates: without a clock it is not CF
    file.attrs["title"] = f"Rocking test {header.test or header.run_id}"
    file.attrs["history"] = f"exported from {selection.run.path.name}, run {header.run_id}"
    for key, value in selection.metadata().items():
        file.attrs[key] = json.dumps(value) if isinstance(value, list) else value


def _time_attributes(selection: Selection) -> dict[str, str]:
    """Attributes of the time axis: dates by CF, or seconds where no wall clock is known."""
    long_name = {"long_name": "time on the run's own axis"}
    started_ns = selection.run.header.start_utc_ns
    if not started_ns:
        return {"units": "s", **long_name}  # an axis of seconds, which CF takes for no date
    zero_ns = started_ns - round(selection.run.first_sample / selection.run.rate_hz * 1e9)
    zero = np.datetime_as_string(np.datetime64(zero_ns, "ns"), unit="us").replace("T", " ")
    return {
        "standard_name": "time",
        "units": f"seconds since {zero}Z",
        "calendar": "standard",
        "units_metadata": "leap_seconds: utc",  # the run's own clock counts every second
        **long_name,
    }


def _create_channels(file: Any, selection: Selection, chunks: tuple[int]) -> list[Any]:
    """An empty variable for each channel, with what is known of the channel as attributes."""
    variables = []
    for channel_id, unit in zip(selection.ids, selection.channel_units, strict=True):
        variable = file.create_variable(_cf_name(channel_id), ("time",), "f8", chunks=chunks, **_COMPRESSION)
        known = selection.channel_metadata(channel_id)
        if "axis" in known:
            known["sensor_axis"] = known.pop("axis")  # `axis` is CF's word for coordinates
        family = known.get("family", "channel")
        variable.attrs.update(
            {"long_name": f"{family} {channel_id}", "channel": channel_id, "units": cf_unit(unit)}
        )
        for key, value in known.items():
            variable.attrs[key] = np.array(value) if isinstance(value, list) else value
        variables.append(variable)
    return variables


def _put_results(file: Any, selection: Selection) -> None:
    """The tidy table along a dimension of its own."""
    rows = selection.results
    file.dimensions["result"] = len(rows)
    words = ("quantity", "source", "unit")
    for name in words:
        variable = file.create_variable(f"result_{name}", ("result",), h5py.string_dtype())
        variable.attrs["long_name"] = f"{name} of each result"
        variable[...] = np.array([getattr(row, name) for row in rows], dtype=object)
    impact = file.create_variable("result_impact", ("result",), "i4")
    impact.attrs.update({"long_name": "impact that begins the half-cycle, or -1", "units": "1"})
    impact[...] = np.array([row.n for row in rows], dtype="i4")
    for name in ("value", "sigma"):
        variable = file.create_variable(f"result_{name}", ("result",), "f8")
        variable.attrs["long_name"] = f"{name} of each result, in the unit that result_unit says"
        numbers = [getattr(row, name) for row in rows]
        variable[...] = np.array([np.nan if number is None else number for number in numbers])


def cf_unit(unit: str) -> str:
    """The unit as UDUNITS, and so CF, writes it."""
    return _CF_UNITS.get(unit, unit)


def _cf_name(channel_id: str) -> str:
    """A name of letters, digits and underscores that begins with a letter, as CF recommends."""
    name = re.sub(r"\W", "_", channel_id, flags=re.ASCII)
    return name if name[0].isalpha() else f"ch_{name}"

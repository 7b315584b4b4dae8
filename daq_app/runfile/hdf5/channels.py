"""What a run file says of each channel: scaling, sensor, place, certificate."""

from __future__ import annotations

from typing import Any

import h5py
import numpy as np

from daq_app.config import Channel
from daq_app.config.families import AUXILIARY
from daq_app.runfile import layout
from daq_app.runfile.model import RunHeader
from daq_app.runfile.source import RunScaling

_TEXT = h5py.string_dtype("utf-8")


def describe_channels(file: h5py.File, header: RunHeader, scaling: RunScaling) -> None:
    """Attributes of the signals in raw and si, and the table of channels.

    Those of raw say how readings become SI, ``si = (raw − zero_reading) · si_per_reading``; those of si
    say what is measured where.
    """
    raw, si = file[layout.RAW], file[layout.SI]
    for index, channel in enumerate(scaling.channels.values()):
        raw[channel.id].attrs.update(
            {
                "zero_reading": float(scaling.scaling.zero[index, 0]),
                "si_per_reading": float(scaling.scaling.gain[index, 0]),
                "si_units": channel.si_unit,
                "offset": channel.offset,
                "tare": header.tare.get(channel.id, 0.0),
                "polarity": channel.polarity,
                "sensitivity": channel.sensitivity,
                "sensitivity_unit": channel.sensitivity_unit,
                "physical_channel": channel.physical_channel,
                "certificate": channel.certificate.number,
                "certificate_due": channel.certificate.due.isoformat(),
            }
        )
        si[channel.id].attrs.update(_sensor(channel))
    for channel_id in header.channel_ids:
        raw[channel_id].attrs["time_offset_s"] = header.time_offset_s(channel_id)
        if channel_id in scaling.channels:
            si[channel_id].attrs["time_offset_s"] = header.time_offset_s(channel_id)
    _write_channels(file, header, scaling)


def _sensor(channel: Channel) -> dict[str, Any]:
    attributes: dict[str, Any] = {
        "long_name": _long_name(channel),
        "family": channel.family,
        "position_m": np.array(channel.position_m),
        "axis": channel.axis,
        "range_si": np.array(channel.range_si),
    }
    if channel.anchor_m is not None:
        attributes["anchor_m"] = np.array(channel.anchor_m)
    return attributes


def _long_name(channel: Channel) -> str:
    if channel.auxiliary:
        return f"{AUXILIARY[channel.family].quantity} at {channel.id}"
    quantity = {
        "lvdt": "opening of the base joint",
        "wire": "shortening of the wire",
        "accelerometer": "acceleration",
        "tiltmeter": "rotation",
    }.get(channel.family, f"reading of the {channel.family}")
    return f"{quantity} at {channel.id}"


def _write_channels(file: h5py.File, header: RunHeader, scaling: RunScaling) -> None:
    """One row per channel: the sensor table with certificates."""
    group = file.create_group(layout.CHANNELS)
    ids = group.create_dataset("channel", data=list(header.channel_ids), dtype=_TEXT)
    ids.make_scale("channel")
    channels = [scaling.channels.get(channel_id) for channel_id in header.channel_ids]
    texts: dict[str, list[str]] = {
        "family": [c.family if c else "" for c in channels],
        "physical_channel": [c.physical_channel if c else "" for c in channels],
        "reading_units": list(header.reading_units),
        "si_units": [c.si_unit if c else "" for c in channels],
        "sensitivity_unit": [c.sensitivity_unit if c else "" for c in channels],
        "certificate": [c.certificate.number if c else "" for c in channels],
        "calibrated": [c.certificate.calibrated.isoformat() if c else "" for c in channels],
        "calibration_due": [c.certificate.due.isoformat() if c else "" for c in channels],
    }
    numbers: dict[str, tuple[str, list[float]]] = {
        "x": ("m", [c.position_m[0] if c else np.nan for c in channels]),
        "y": ("m", [c.position_m[1] if c else np.nan for c in channels]),
        "z": ("m", [c.position_m[2] if c else np.nan for c in channels]),
        "sensitivity": ("see sensitivity_unit", [c.sensitivity if c else np.nan for c in channels]),
        "offset": ("see reading_units", [c.offset if c else np.nan for c in channels]),
        "tare": ("see reading_units", [header.tare.get(i, 0.0) for i in header.channel_ids]),
        "polarity": ("1", [float(c.polarity) if c else np.nan for c in channels]),
        "time_offset": ("s", [header.time_offset_s(i) for i in header.channel_ids]),
    }
    for name, values in texts.items():
        dataset = group.create_dataset(name, data=values, dtype=_TEXT)
        dataset.dims[0].attach_scale(ids)
    for name, (unit, column) in numbers.items():
        dataset = group.create_dataset(name, data=np.array(column, dtype=np.float64))
        dataset.attrs["units"] = unit
        dataset.dims[0].attach_scale(ids)

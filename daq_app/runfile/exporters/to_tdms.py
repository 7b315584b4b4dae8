"""TDMS, as LabVIEW and DIAdem read it: one group of waveforms with units and increments."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

from daq_app.runfile.exporters.selection import Selection

GROUP: Final = "Measurement"
DERIVED_GROUP: Final = "Derived"
RESULTS_GROUP: Final = "Results"
_WAVEFORM: Final = ("wf_increment", "wf_start_time", "wf_start_offset", "wf_samples")


def write(path: Path, selection: Selection) -> None:
    """One segment per piece; the properties stand in the first."""
    run = selection.run
    # The waveform of a TDMS channel starts at a wall-clock time plus an offset in seconds: the offset is the
    # run's own time of the first row, so the wall clock is that of the run's time zero.
    zero_ns = run.header.start_utc_ns - round(run.first_sample / run.rate_hz * 1e9)
    started = np.datetime64(zero_ns // 1000 if run.header.start_utc_ns else 0, "us")
    known = {
        key: json.dumps(value, ensure_ascii=False) if isinstance(value, list) else value
        for key, value in selection.metadata().items()
    }
    offset_s = (run.first_sample + selection.start) / run.rate_hz
    with TdmsWriter(str(path)) as writer:
        objects: list[Any] = [RootObject({"name": run.header.test or run.header.run_id, **known})]
        objects.append(GroupObject(GROUP))
        properties = [
            {
                "unit_string": unit,
                "NI_ChannelName": channel_id,
                "wf_increment": 1.0 / run.rate_hz,
                "wf_start_time": started,
                "wf_start_offset": offset_s,
                "wf_samples": selection.n_samples,
                **{
                    key: json.dumps(value) if isinstance(value, list) else value
                    for key, value in selection.channel_metadata(channel_id).items()
                },
            }
            for channel_id, unit in zip(selection.ids, selection.channel_units, strict=True)
        ]
        wave = {key: properties[0][key] for key in _WAVEFORM} if properties else {}
        for _, values in selection.pieces():
            channels = [
                ChannelObject(GROUP, channel_id, row, properties=known_here)
                for channel_id, row, known_here in zip(selection.ids, values, properties, strict=True)
            ]
            writer.write_segment([*objects, *channels])
            objects = []
            properties = [{} for _ in properties]
        for column in selection.derived:
            known_here = {"unit_string": column.unit, "description": column.long_name, **wave}
            writer.write_segment(
                [ChannelObject(DERIVED_GROUP, column.name, column.values, properties=known_here)]
            )
        if selection.results:
            writer.write_segment(_results(selection))


def _results(selection: Selection) -> list[Any]:
    """The tidy table as channels of one group."""
    rows = selection.results
    columns: dict[str, Any] = {
        "quantity": [row.quantity for row in rows],
        "source": [row.source for row in rows],
        "n": np.array([row.n for row in rows], dtype=np.int32),
        "value": np.array([row.value for row in rows]),
        "sigma": np.array([np.nan if row.sigma is None else row.sigma for row in rows]),
        "unit": [row.unit for row in rows],
    }
    return [ChannelObject(RESULTS_GROUP, name, values) for name, values in columns.items()]

"""TDMS, as LabVIEW and DIAdem read it: one group of waveforms with units and increments."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

from daq_app.runfile.exporters.selection import Selection

GROUP: Final = "Measurement"


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
        for _, values in selection.pieces():
            channels = [
                ChannelObject(GROUP, channel_id, row, properties=known_here)
                for channel_id, row, known_here in zip(selection.ids, values, properties, strict=True)
            ]
            writer.write_segment([*objects, *channels])
            objects = []
            properties = [{} for _ in properties]

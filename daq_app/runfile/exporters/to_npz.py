"""NumPy's archive: `data` (channels × samples), `names`, `units`, `fs`, and the metadata as JSON."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from daq_app.runfile.exporters.selection import Selection


def write(path: Path, selection: Selection) -> None:
    """Nothing in it needs pickle. `data` is written channel by channel, not held in memory."""
    metadata = selection.metadata()
    metadata["channels"] = {
        channel_id: selection.channel_metadata(channel_id) for channel_id in selection.ids
    }
    small: dict[str, Any] = {
        "names": np.array(selection.ids),
        "units": np.array(selection.channel_units),
        "fs": np.float64(selection.run.rate_hz),
        "first_sample": np.int64(metadata["first_sample"]),
        "metadata_json": np.array(json.dumps(metadata)),
    }
    if selection.derived:
        small["derived_names"] = np.array([column.name for column in selection.derived])
        small["derived_units"] = np.array([column.unit for column in selection.derived])
        small["derived"] = np.array([column.values for column in selection.derived])
    if selection.results:
        for field in ("quantity", "source", "n", "value", "unit"):
            small[f"results_{field}"] = np.array([getattr(row, field) for row in selection.results])
        sigmas = [np.nan if row.sigma is None else row.sigma for row in selection.results]
        small["results_sigma"] = np.array(sigmas)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
        for name, value in small.items():
            with archive.open(f"{name}.npy", "w") as member:
                npy.write_array(member, np.asarray(value), allow_pickle=False)
        with archive.open("data.npy", "w", force_zip64=True) as member:
            shape = (len(selection.ids), selection.n_samples)
            head = {"descr": "<f8", "fortran_order": False, "shape": shape}
            npy.write_array_header_1_0(member, head)
            for number, channel_id in enumerate(selection.ids):
                for piece in selection.channel_pieces(channel_id):
                    member.write(piece.data)
                selection.report((number + 1) / len(selection.ids))

"""Parquet: one column per channel, one row group per piece, metadata in the schema."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.exporters.selection import Selection


def write(path: Path, selection: Selection) -> None:
    """Needs the optional package pyarrow; raises `RunFileError` where it is absent."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise RunFileError(
            "Parquet needs the package pyarrow",
            advice="Install it: pip install rocking-test-recorder[formats].",
        ) from error
    fields = [pa.field("time_s", pa.float64(), nullable=False, metadata={"unit": "s"})]
    for channel_id, unit in zip(selection.ids, selection.channel_units, strict=True):
        known = json.dumps(selection.channel_metadata(channel_id))
        fields.append(
            pa.field(channel_id, pa.float64(), nullable=False, metadata={"unit": unit, "channel": known})
        )
    for column in selection.derived:
        described = {"unit": column.unit, "derived": column.long_name}
        fields.append(pa.field(column.name, pa.float64(), nullable=False, metadata=described))
    metadata = {key: json.dumps(value) for key, value in selection.metadata().items()}
    if selection.results:
        metadata["results"] = json.dumps([asdict(row) for row in selection.results])
    schema = pa.schema(fields, metadata=metadata)
    # Float columns of noise gain nothing from a dictionary; BYTE_STREAM_SPLIT is Parquet's shuffle.
    options = {"compression": "zstd", "use_dictionary": False, "use_byte_stream_split": True}
    with pq.ParquetWriter(path, schema, **options) as writer:
        at = 0
        for times, values in selection.pieces():
            derived = [column.values[at : at + times.size] for column in selection.derived]
            writer.write_table(pa.table([times, *values, *derived], schema=schema))
            at += times.size

"""The map of an import: which column is which sensor, and what the foreign file does not say or says wrong.

Example::

    [run]
    test = "FR1-L3-2"

    [source]
    rate_hz = 4000.0          # the file's own increment is rounded

    [channels.LV-A01]
    from = "Measurement/Kanal 1"
    unit = "mm"

    [channels.WP-1]
    from = "Measurement/Kanal 25"
    unit = "V"
"""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from daq_app.config import ConfigError
from daq_app.config.toml_file import parse_toml, read_text
from daq_app.config.validation import problems_of

_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Rate = Annotated[float, Field(gt=0, le=1e7, allow_inf_nan=False)]


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


class ChannelMap(_Table):
    """Where one channel of the rig is in the file."""

    source: Annotated[str, Field(alias="from", min_length=1)]
    """Its name in the file (``Group/Channel`` in TDMS)."""
    unit: str = ""
    """Unit of the numbers in the file; empty means what the file says."""
    scale: _Finite = 1.0
    offset: _Finite = 0.0
    """Applied first: number · scale + offset, in `unit`."""


class SourceMap(_Table):
    """How to read the file where it does not say so itself."""

    group: str = ""
    """TDMS group to take channels from."""
    rate_hz: _Rate | None = None
    """Sampling rate, if the file's is absent or wrong."""
    time_column: str = ""
    """Name of the column of times; empty means the one the file marks, if any."""
    delimiter: Literal["", ",", ";", "\t", " "] = ""
    """Delimiter of a CSV file; empty means that it is found out."""
    decimal: Literal["", ".", ","] = ""
    skip_lines: Annotated[int, Field(ge=0, le=10000)] = 0
    """Lines before the CSV's line of names."""
    has_names: bool = True
    """False for a CSV without a line of names: its columns are ``column 1`` and so on."""
    start_utc: dt.datetime | None = None
    """Date and time of the first sample, if the file's is absent or wrong."""


class RunMap(_Table):
    """What to call the run."""

    test: str = ""
    specimen: str = ""
    notes: str = ""


class ImportMap(_Table):
    """A whole map. Without `channels`, those whose names are ids of the rig are taken."""

    run: RunMap = RunMap()
    source: SourceMap = SourceMap()
    channels: dict[str, ChannelMap] = Field(default_factory=dict)


def load_import_map(path: Path) -> ImportMap:
    """Read a map file. Raises `ConfigError` with all problems in it."""
    data = parse_toml(read_text(path), str(path))
    try:
        return ImportMap.model_validate(data)
    except ValidationError as error:
        raise ConfigError(problems_of(error, ImportMap, str(path))) from None

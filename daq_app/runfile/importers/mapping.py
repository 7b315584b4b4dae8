"""Which column of a foreign file is which channel of the rig, and by what factor."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq_app.config import Channel, Rig, Scaling
from daq_app.config.validation import nearest
from daq_app.runfile.errors import RunFileError
from daq_app.runfile.importers.import_map import ChannelMap, ImportMap
from daq_app.runfile.importers.recording import ForeignChannel, Reader
from daq_app.runfile.importers.unit_text import is_time, parse_unit


@dataclass(frozen=True, slots=True)
class MappedChannel:
    """One channel of the rig and its column."""

    channel: Channel
    foreign: ForeignChannel
    unit: str
    """Unit of the column as used."""
    scale: float
    offset: float
    factor: float
    """From `unit` to SI or to the unit of the reading."""
    is_reading: bool
    """The column holds readings (volts), not engineering values."""

    def to_readings(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Numbers of the file (m,) to readings (m,)."""
        if self.scale != 1.0 or self.offset != 0.0:
            values = values * self.scale + self.offset
        if self.factor != 1.0:
            values = values * self.factor
        if self.is_reading:
            return values
        readings: NDArray[np.float64] = Scaling.of([self.channel]).to_readings(values[None, :])[0]
        return readings

    def origin(self) -> dict[str, Any]:
        """How the readings came about, for the header."""
        return {
            "from": self.foreign.name,
            "unit": self.unit,
            "unit_in_file": self.foreign.unit,
            "scale": self.scale,
            "offset": self.offset,
            "readings": "as in the file"
            if self.is_reading
            else "computed from engineering values with the rig's sensitivity",
        }


def map_channels(path: Path, reader: Reader, rig: Rig, import_map: ImportMap) -> tuple[MappedChannel, ...]:
    """Find every channel, in rig order. Raises `RunFileError` with everything that is wrong, at once."""
    wrong: list[str] = []
    unknown = [key for key in import_map.channels if key not in rig.channel_ids]
    for key in unknown:
        near = nearest(key, rig.channel_ids)
        hint = f" (did you mean {near[0]}?)" if near else ""
        wrong.append(f"the rig has no channel {key}{hint}")
    mapped: list[MappedChannel] = []
    for channel in rig.channels:
        entry = import_map.channels.get(channel.id)
        if entry is None and import_map.channels:
            continue
        try:
            foreign = _find(reader, import_map.source.group, entry.source if entry else channel.id)
            if foreign is not None:
                mapped.append(_with_unit(channel, foreign, entry))
            elif entry is not None:
                near = nearest(entry.source, [item.name for item in reader.channels])
                hint = f"; did you mean {near[0]!r}?" if near else ""
                wrong.append(f"{channel.id}: the file has no channel {entry.source!r}{hint}")
        except ValueError as error:
            wrong.append(f"{channel.id}: {error}")
    if not mapped and not wrong:
        wrong.append("no channel of the file has the name of a channel of the rig")
    if wrong:
        names = ", ".join(repr(item.name) for item in reader.channels[:60])
        raise RunFileError(
            f"{path} cannot be mapped to the rig {rig.name}: {'; '.join(wrong)}",
            advice=f"Name the columns in a map (--map). The file has {names or 'no numeric channels'}.",
        )
    missing = [channel.id for channel in rig.channels if channel.id not in {m.channel.id for m in mapped}]
    if missing:
        listing = f": {', '.join(missing)}" if len(missing) <= 8 else ""
        reader.findings.doubts.append(
            f"no data for {len(missing)} of the rig's {len(rig.channels)} channels{listing}"
        )
    return tuple(mapped)


def _find(reader: Reader, group: str, name: str) -> ForeignChannel | None:
    """By full name, else by a short one; `ValueError` if several could be meant."""
    wanted = {name, f"{group}/{name}"} if group else {name}
    exact = [item for item in reader.channels if item.name in wanted]
    if exact:
        return exact[0]
    short = [item for item in reader.channels if name in item.aliases]
    if group:
        short = [item for item in short if item.name.startswith(f"{group}/")]
    if len(short) > 1:
        short = [item for item in short if item.preferred] or short
    if len(short) > 1:
        raise ValueError(f"{name!r} may be {' or '.join(repr(item.name) for item in short[:5])}")
    return short[0] if short else None


def _with_unit(channel: Channel, foreign: ForeignChannel, entry: ChannelMap | None) -> MappedChannel:
    unit = (entry.unit if entry else "") or foreign.unit
    scale, offset = (entry.scale, entry.offset) if entry else (1.0, 0.0)
    parsed = parse_unit(unit)
    ask = f'give unit = "…" in the map ({channel.si_unit} or {channel.reading_unit} in some multiple)'
    if not unit:
        raise ValueError(f"the file gives no unit for {foreign.name!r}; {ask}")
    if is_time(unit):
        raise ValueError(f"the file says {foreign.name!r} is in {unit!r}, which is a unit of time; {ask}")
    if parsed is None and unit.strip() == channel.si_unit:
        parsed = (channel.si_unit, 1.0)
    if parsed is None or parsed[0] not in (channel.si_unit, channel.reading_unit):
        raise ValueError(f"{unit!r} cannot be the unit of a sensor of family {channel.family}; {ask}")
    is_reading = parsed[0] == channel.reading_unit
    return MappedChannel(channel, foreign, unit, scale, offset, parsed[1], is_reading)

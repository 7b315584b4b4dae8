"""TDMS of LabVIEW, SignalExpress, DIAdem and DAQmx logging, through npTDMS.

npTDMS applies the scalings of unscaled DAQmx data and reads both byte orders.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
from nptdms import TdmsChannel, TdmsFile
from numpy.typing import NDArray

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.importers.import_map import SourceMap
from daq_app.runfile.importers.recording import Findings, ForeignChannel, Spool

_WHOLE_CHUNK_BYTES: Final = 2**26
"""Chunks of all channels up to this size are read at once; larger ones channel by channel."""
_MAX_LISTED: Final = 20_000
_MAX_MESSAGE: Final = 200
_LONGEST_OFFSET_S: Final = 1e8
"""A waveform that begins years after its own start is not believed."""


class TdmsReader:
    """See `Reader`. Memory: one chunk of the file, as its writer made them (usually a second or less)."""

    def __init__(self, path: Path, source: SourceMap) -> None:
        self._path = path
        self.findings = Findings()
        with self._told("cannot be read as TDMS"):
            self._file = TdmsFile.open(path)
        try:
            with self._told("cannot be read as TDMS"):
                self._by_name = _numeric_channels(self._file)
                levels = {g.name: g.properties.get("DecimationLevel", 0) for g in self._file.groups()}
                self.channels = tuple(
                    _describe(name, channel, levels) for name, channel in self._by_name.items()
                )
            if len(self._by_name) > _MAX_LISTED:
                raise RunFileError(f"{path} has {len(self._by_name)} channels, which cannot be true")
            if source.time_column and source.time_column not in self._by_name:
                raise RunFileError(f"{path} has no channel of times {source.time_column!r}")
        except BaseException:
            self._file.close()
            raise
        self.time_channel: str | None = None
        self.time_hint: str | None = None

    def copy(self, spool: Spool) -> None:
        with self._told("is damaged"):
            chosen = {name: self._by_name[name] for name in spool.names}
            if self._chunks_are_small(chosen):
                for chunk in self._file.data_chunks():
                    for name, channel in chosen.items():
                        values = chunk[channel.group_name][channel.name][:]
                        spool.append(name, _numbers(values))
            else:
                for name, channel in chosen.items():
                    for part in channel.data_chunks():
                        spool.append(name, _numbers(part[:]))

    def close(self) -> None:
        self._file.close()

    def _chunks_are_small(self, chosen: dict[str, TdmsChannel]) -> bool:
        """Whether one chunk of all channels fits, judged by the first chunk of each chosen one."""
        longest = 0
        for channel in chosen.values():
            first = next(iter(channel.data_chunks()), None)
            longest = max(longest, len(first) if first is not None else 0)
            if longest * 8 * len(self._by_name) > _WHOLE_CHUNK_BYTES:
                return False
        return True

    @contextmanager
    def _told(self, what: str) -> Iterator[None]:
        """npTDMS raises many kinds of errors and logs what it doubts: both reach the operator."""
        heard = _Listener(self.findings.doubts)
        loggers = [logging.getLogger(name) for name in logging.root.manager.loggerDict if "nptdms" in name]
        # Its own handlers would write to the terminal, damaged bytes and all.
        before = [(logger, logger.handlers, logger.propagate) for logger in loggers]
        for logger in loggers:
            logger.handlers, logger.propagate = [heard], False
        try:
            yield
        except RunFileError:
            raise
        except Exception as error:
            reason = str(error) or type(error).__name__
            raise RunFileError(
                f"{self._path} {what} ({reason})", advice="Is it a whole TDMS file?"
            ) from error
        finally:
            for logger, handlers, propagate in before:
                logger.handlers, logger.propagate = handlers, propagate


class _Listener(logging.Handler):
    def __init__(self, doubts: list[str]) -> None:
        super().__init__(logging.WARNING)
        self._doubts = doubts

    def emit(self, record: logging.LogRecord) -> None:
        text = f"TDMS: {record.getMessage()[:_MAX_MESSAGE]}"
        if text not in self._doubts and len(self._doubts) < 100:
            self._doubts.append(text)


def _numeric_channels(file: TdmsFile) -> dict[str, TdmsChannel]:
    """Channels of numbers or times by ``Group/Channel``."""
    return {
        f"{group.name}/{channel.name}": channel
        for group in file.groups()
        for channel in group.channels()
        if np.issubdtype(channel.dtype, np.number) or np.issubdtype(channel.dtype, np.datetime64)
    }


def _describe(name: str, channel: TdmsChannel, levels: dict[str, Any]) -> ForeignChannel:
    properties = channel.properties
    aliases = {channel.name, str(properties.get("NI_ChannelName", channel.name))}
    increment = properties.get("wf_increment")
    return ForeignChannel(
        name,
        unit=str(properties.get("unit_string", "")),
        increment_s=float(increment) if isinstance(increment, int | float) and increment != 0 else None,
        start_utc_ns=_start(properties.get("wf_start_time"), properties.get("wf_start_offset")),
        aliases=tuple(aliases),
        preferred=levels.get(channel.group_name, 0) == 0,
    )


def _start(value: object, offset_s: object) -> int | None:
    """UTC of the first sample: a TDMS timestamp and the seconds behind it; its epoch (1904) means none."""
    if not isinstance(value, np.datetime64) or np.isnat(value) or value < np.datetime64("1970-01-01"):
        return None
    known = isinstance(offset_s, int | float) and abs(offset_s) < _LONGEST_OFFSET_S
    late_us = round(float(offset_s) * 1e6) if known and isinstance(offset_s, int | float) else 0
    return (int(value.astype("datetime64[us]").astype(np.int64)) + late_us) * 1000


def _numbers(values: NDArray[Any]) -> NDArray[np.float64]:
    if np.issubdtype(values.dtype, np.datetime64):
        # Seconds since 2000 keep a microsecond exact in a double for two centuries.
        seconds = (values - np.datetime64("2000-01-01")) / np.timedelta64(1, "s")
        return np.asarray(seconds, dtype=np.float64)
    if np.iscomplexobj(values):
        raise RunFileError("a channel of complex numbers is no recording of a sensor")
    return np.asarray(values, dtype=np.float64)

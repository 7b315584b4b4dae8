"""Electronic data sheets of sensors (TEDS, IEEE 1451.4): what a sensor says of itself.

A virtual TEDS file holds one byte for each bit, least significant bit first: the mark ``[v03]``, then the
basic TEDS (64 bits) and a template.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sim_hardware.daqmx_server.errors import Code, DaqmxError

_BASIC: Final = (("manufacturer", 14), ("model", 15), ("letter", 5), ("version", 6), ("serial", 24))
_SELECTOR_BITS: Final = 2
_TEMPLATE_BITS: Final = 8
_FILE_MARK: Final = b"[v03]"


class Bits:
    """Fields read one after the other."""

    def __init__(self, bits: Sequence[int]) -> None:
        self._bits = bits
        self._next = 0

    def take(self, width: int) -> int:
        """The next field as an unsigned number; −200826 beyond the end."""
        piece = self._bits[self._next : self._next + width]
        if len(piece) < width:
            raise DaqmxError(Code.TEDS_DATA)
        self._next += width
        return sum(int(bit) << place for place, bit in enumerate(piece))

    def take_float(self) -> float:
        """The next field as an IEEE single."""
        (value,) = struct.unpack("<f", struct.pack("<I", self.take(32)))
        return float(value)

    def take_linear(self, width: int, start: float, step: float) -> float:
        """A field of constant resolution (ConRes): start + step × code."""
        return start + step * self.take(width)

    def take_relative(self, width: int, start: float, tolerance: float) -> float:
        """A field of constant relative resolution (ConRelRes): start × (1 + 2 tolerance)^code."""
        return float(start * (1.0 + 2.0 * tolerance) ** self.take(width))

    def rest(self) -> tuple[int, ...]:
        """The bits that no field has taken yet."""
        return tuple(self._bits[self._next :])


@dataclass(frozen=True, slots=True)
class DataSheet:
    """Basic TEDS and the template that follows."""

    stream: bytes
    """All of it, eight bits a byte, least significant first."""
    manufacturer: int
    model: int
    letter: str
    version: int
    serial: int
    template: int
    fields: tuple[int, ...]
    """Bits behind the template's number."""

    @classmethod
    def from_stream(cls, stream: Sequence[int]) -> DataSheet:
        """From packed bytes. −200826 for what is no data sheet."""
        reader = Bits(unpacked(bytes(stream)))
        values = {name: reader.take(width) for name, width in _BASIC}
        if reader.take(_SELECTOR_BITS):
            raise DaqmxError(Code.TEDS_DATA)  # a template of the maker's own: nobody here can read it
        template = reader.take(_TEMPLATE_BITS)
        return cls(
            bytes(stream),
            values["manufacturer"],
            values["model"],
            chr(ord("A") + values["letter"] - 1) if values["letter"] else "",
            values["version"],
            values["serial"],
            template,
            reader.rest(),
        )


def unpacked(stream: bytes) -> tuple[int, ...]:
    """Bits of bytes, least significant first."""
    return tuple(byte >> place & 1 for byte in stream for place in range(8))


def read_data_sheet(path: str) -> DataSheet:
    """The data sheet of a virtual TEDS file. −200826 for a file that is none."""
    try:
        bits = Path(path).read_bytes()
    except OSError:
        raise DaqmxError(Code.TEDS_DATA, f"File Path: {path}") from None
    mark = unpacked(_FILE_MARK)
    if any(bit not in (0, 1) for bit in bits) or tuple(bits[: len(mark)]) != mark:
        raise DaqmxError(Code.TEDS_DATA, f"File Path: {path}")
    reader = Bits(bits[len(mark) :] + bytes(-len(bits) % 8))
    return DataSheet.from_stream([reader.take(8) for _ in range(-(-(len(bits) - len(mark)) // 8))])

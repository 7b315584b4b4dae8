"""Electronic data sheets of sensors (TEDS, IEEE 1451.4): what a sensor says of itself.

A virtual TEDS file holds one byte for each bit, least significant bit first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sim_hardware.daqmx_server.errors import Code, DaqmxError

_BASIC: Final = (("manufacturer", 14), ("model", 15), ("letter", 5), ("version", 6), ("serial", 24))
_SELECTOR_BITS: Final = 2
_TEMPLATE_BITS: Final = 8


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

    def skip(self, width: int) -> None:
        self._next += width


@dataclass(frozen=True, slots=True)
class DataSheet:
    """Basic TEDS and the template that follows."""

    bits: tuple[int, ...]
    manufacturer: int
    model: int
    letter: str
    version: int
    serial: int
    template: int

    @classmethod
    def from_bits(cls, bits: Sequence[int]) -> DataSheet:
        """−200826 for what is no data sheet."""
        if any(bit not in (0, 1) for bit in bits):
            raise DaqmxError(Code.TEDS_DATA)
        reader = Bits(bits)
        values = {name: reader.take(width) for name, width in _BASIC}
        reader.skip(_SELECTOR_BITS)
        template = reader.take(_TEMPLATE_BITS)
        letter = chr(ord("A") + values["letter"] - 1) if values["letter"] else ""
        return cls(
            tuple(bits),
            values["manufacturer"],
            values["model"],
            letter,
            values["version"],
            values["serial"],
            template,
        )


def read_data_sheet(path: str) -> DataSheet:
    """The data sheet of a virtual TEDS file. −200826 for a file that is none."""
    try:
        return DataSheet.from_bits(tuple(Path(path).read_bytes()))
    except OSError:
        raise DaqmxError(Code.TEDS_DATA, f"File Path: {path}") from None

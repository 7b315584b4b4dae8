"""Virtual TEDS files: data sheets of sensors, bit by bit."""

from __future__ import annotations

import struct
from pathlib import Path


def as_bits(*fields: tuple[int, int]) -> list[int]:
    """Fields (value, width) as bits, least significant first."""
    return [value >> place & 1 for value, width in fields for place in range(width)]


def single(value: float) -> tuple[int, int]:
    return struct.unpack("<I", struct.pack("<f", value))[0], 32


def data_sheet_file(folder: Path, template: int, *fields: tuple[int, int]) -> Path:
    """A virtual TEDS file: maker 17, model 1, version A1, number 12345, then a template."""
    basic = ((17, 14), (1, 15), (1, 5), (1, 6), (12345, 24), (0, 2), (template, 8))
    mark = [byte >> place & 1 for byte in b"[v03]" for place in range(8)]
    path = folder / f"{template}.ted"
    path.write_bytes(bytes(mark + as_bits(*basic, *fields, (0, 64))))
    return path

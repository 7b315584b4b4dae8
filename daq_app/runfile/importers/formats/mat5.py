"""Numbers and texts out of MATLAB 5 files, in pieces.

SciPy's reader is not used on foreign files: a few changed bytes in a structure make it crash the
interpreter (found by the fuzz test beside this package), and it holds whole variables in memory.
Source: The MathWorks, "MAT-File Format", level 5.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from daq_app.runfile.errors import RunFileError

_STORED: Final = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Type of an element's numbers by its number in the file; a double array may be stored as bytes."""
_MATRIX: Final = 14
_COMPRESSED: Final = 15
_CHAR_CLASS: Final = 4
_NUMERIC_CLASSES: Final = range(6, 16)
_COMPLEX: Final = 0x0800
_HEAD_BYTES: Final = 128
_PIECE: Final = 2**20
_MAX_VARIABLES: Final = 20_000
_MAX_TEXT: Final = 2**22
_UTF: Final = {16: "utf-8", 17: "utf-16", 18: "utf-32", 4: "utf-16", 1: "latin-1", 2: "latin-1"}


@dataclass(frozen=True, slots=True)
class Variable:
    """Head of one variable at the top of the file."""

    name: str
    shape: tuple[int, ...]
    is_text: bool
    is_real: bool
    """A real numeric array (not complex, sparse, a structure, a cell)."""
    offset: int
    """Place of its element in the file, bytes."""

    @property
    def size(self) -> int:
        product = 1
        for length in self.shape:
            product *= length
        return product


class _Stream(Protocol):
    def read(self, n_bytes: int) -> bytes: ...


class _Inflated:
    """The bytes of a compressed element, no more at a time than asked for."""

    def __init__(self, file: BinaryIO, n_bytes: int) -> None:
        self._file, self._left = file, n_bytes
        self._inflate = zlib.decompressobj()
        self._input = b""

    def read(self, n_bytes: int) -> bytes:
        parts: list[bytes] = []
        while n_bytes > 0 and not self._inflate.eof:
            if not self._input and self._left:
                self._input = self._file.read(min(self._left, 2**16))
                self._left -= len(self._input)
            part = self._inflate.decompress(self._input, n_bytes)
            if not part and not self._input:
                break
            self._input = self._inflate.unconsumed_tail
            parts.append(part)
            n_bytes -= len(part)
        return b"".join(parts)


class Mat5File:
    """An opened file. Raises `RunFileError` for anything that is not as the format wants it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._file = path.open("rb")
        except OSError as error:
            raise RunFileError(
                f"{path} cannot be read ({error.strerror})", advice="Check the name."
            ) from error
        try:
            head = self._file.read(_HEAD_BYTES)
            order = {b"IM": "<", b"MI": ">"}.get(head[126:128])
            if order is None:
                raise RunFileError(f"{path} is no MATLAB file", advice="Save it with -v7 or -v7.3.")
            self._order = order
            self.variables = {variable.name: variable for variable in self._scan()}
        except BaseException:
            self._file.close()
            raise

    def numbers(self, variable: Variable) -> Iterator[NDArray[np.float64]]:
        """The variable's numbers in the order of the file (column after column)."""
        stream, kind, n_bytes = self._at_data(variable)
        if kind not in _STORED:
            raise self._damaged(f"{variable.name} is stored as something unknown")
        dtype = np.dtype(self._order + _STORED[kind])
        if n_bytes != variable.size * dtype.itemsize:
            raise self._damaged(f"{variable.name} has not as many numbers as its shape says")
        while n_bytes:
            part = self._exactly(stream, min(n_bytes, _PIECE))
            n_bytes -= len(part)
            yield np.frombuffer(part, dtype=dtype).astype(np.float64)

    def text(self, variable: Variable) -> str:
        """A row of characters."""
        stream, kind, n_bytes = self._at_data(variable)
        if n_bytes > _MAX_TEXT or kind not in _UTF:
            raise self._damaged(f"{variable.name} is no text")
        name = _UTF[kind]
        if name in ("utf-16", "utf-32"):
            name += "-le" if self._order == "<" else "-be"
        return self._exactly(stream, n_bytes).decode(name, "replace")

    def close(self) -> None:
        """Close the file; safe twice."""
        self._file.close()

    def _scan(self) -> Iterator[Variable]:
        size = self._file.seek(0, 2)
        offset = _HEAD_BYTES
        for _ in range(_MAX_VARIABLES):
            if offset + 8 > size:
                return
            self._file.seek(offset)
            _, n_bytes = self._unpack("II", self._file.read(8))
            if offset + 8 + n_bytes > size:
                raise self._damaged("it is cut short")
            variable = self._head_of(offset)
            if variable is not None:
                yield variable
            offset += 8 + n_bytes
        raise self._damaged("it has absurdly many variables")

    def _open_element(self, offset: int) -> tuple[_Stream, int]:
        """The bytes inside a matrix element, inflated if need be; (stream, type)."""
        self._file.seek(offset)
        kind, n_bytes = self._unpack("II", self._file.read(8))
        if kind != _COMPRESSED:
            return self._file, kind
        stream = _Inflated(self._file, n_bytes)
        inner, _ = self._unpack("II", self._exactly(stream, 8))
        return stream, inner

    def _head_of(self, offset: int) -> Variable | None:
        stream, kind = self._open_element(offset)
        if kind != _MATRIX:
            return None
        return self._read_head(stream, offset)

    def _read_head(self, stream: _Stream, offset: int) -> Variable:
        flags = self._small(stream, 8)
        if len(flags) < 4:
            raise self._damaged("a variable has no flags")
        (word,) = self._unpack("I", flags[:4])
        dims = self._small(stream, 4 * 32)
        name = self._small(stream, 1024).decode("latin-1").rstrip("\0")
        shape = tuple(self._unpack(f"{len(dims) // 4}i", dims[: len(dims) // 4 * 4]))
        if len(shape) < 2 or any(length < 0 for length in shape):
            raise self._damaged(f"{name!r} has the shape {shape}")
        class_ = word & 0xFF
        real = class_ in _NUMERIC_CLASSES and not word & _COMPLEX
        return Variable(name, shape, class_ == _CHAR_CLASS, real, offset)

    def _at_data(self, variable: Variable) -> tuple[_Stream, int, int]:
        """Stream standing at the variable's numbers; their type and bytes."""
        stream, _ = self._open_element(variable.offset)
        self._read_head(stream, variable.offset)
        kind, n_bytes, inline = self._tag(stream)
        return (stream if inline is None else io.BytesIO(inline)), kind, n_bytes

    def _tag(self, stream: _Stream) -> tuple[int, int, bytes | None]:
        """Type and length of the element that follows; short ones keep their data in the tag."""
        raw = self._exactly(stream, 8)
        (first,) = self._unpack("I", raw[:4])
        if first >> 16:  # small element: length and type share a word, the other word is the data
            inline = raw[4 : 4 + min(first >> 16, 4)]
            return first & 0xFFFF, len(inline), inline
        return first, self._unpack("I", raw[4:])[0], None

    def _small(self, stream: _Stream, limit: int) -> bytes:
        """A whole short element with its padding."""
        _, n_bytes, inline = self._tag(stream)
        if inline is not None:
            return inline
        if n_bytes > limit:
            raise self._damaged("the head of a variable is absurdly long")
        return self._exactly(stream, n_bytes + -n_bytes % 8)[:n_bytes]

    def _exactly(self, stream: _Stream, n_bytes: int) -> bytes:
        parts = []
        try:
            while n_bytes:
                part = stream.read(n_bytes)
                if not part:
                    raise self._damaged("it is cut short")
                parts.append(part)
                n_bytes -= len(part)
        except zlib.error as error:
            raise self._damaged(str(error)) from error
        return b"".join(parts)

    def _unpack(self, form: str, data: bytes) -> tuple[int, ...]:
        try:
            return struct.unpack(self._order + form, data)
        except struct.error as error:
            raise self._damaged("it is cut short") from error

    def _damaged(self, why: str) -> RunFileError:
        return RunFileError(f"{self._path} is damaged or no MATLAB file: {why}")

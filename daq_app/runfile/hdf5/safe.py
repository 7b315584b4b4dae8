"""Reading HDF5 that may come from anybody: proven or probed bytes, bounded memory, nothing outside the file.

Refused: external links, soft links, external storage, virtual datasets, filters other than the standard
ones, and datasets that claim more than their bytes on disk could hold.
"""

from __future__ import annotations

import atexit
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import h5py

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.hdf5.probe import require_harmless
from daq_app.runfile.seal.format import BrokenSealError, Seal
from daq_app.runfile.seal.proven_file import ProvenFile, seal_of
from daq_app.runfile.seal.trust import is_believed

_MAX_CHUNK_BYTES: Final = 2**26
_MAX_DEFLATE_RATIO: Final = 1100
"""Deflate cannot shrink more than about 1032 times; a claim beyond is a forged shape."""
_MAX_TEXT_BYTES: Final = 2**28
_MAX_ROWS: Final = 1_000_000
_FILTERS: Final = frozenset({h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_FLETCHER32})


@atexit.register
def _close_what_is_still_open() -> None:
    """HDF5 closes open files after Python has ended; one that is read through Python would crash there."""
    for file in h5py.h5f.get_obj_ids(types=h5py.h5f.OBJ_FILE):
        if file.get_access_plist().get_driver() == h5py.h5fd.fileobj_driver:
            h5py.File(file).close()


@dataclass(frozen=True, slots=True)
class OpenedHdf5:
    """An HDF5 file opened for reading, and what proves its bytes."""

    file: h5py.File
    seal: Seal | None
    """None for a file that was never sealed; it was walked through by a child before it was opened here."""
    proven: ProvenFile | None = None
    """What the HDF5 library reads a sealed file through, and does not close."""

    def close(self) -> None:
        """Close the file; safe twice. Windows lets nobody rename or remove it before."""
        self.file.close()
        if self.proven is not None:
            self.proven.close()


def open_hdf5(path: Path, *, just_written: bool = False, just_proven: bool = False) -> OpenedHdf5:
    """Open for reading. Raises `RunFileError` in plain words.

    The HDF5 library sees proven bytes only where the file has a seal.  A file that this machine did not
    seal itself is given to a child first (`require_harmless`), unless it was `just_written` by the caller.
    Blocks are not proven again where the caller has `just_proven` every one of them.
    """
    try:
        seal = seal_of(path)
    except BrokenSealError as error:
        raise RunFileError(f"{path}: {error.message}", advice=error.advice) from error
    except OSError as error:
        raise RunFileError(f"{path} cannot be read ({error.strerror})", advice="Check the name.") from error
    try:
        if not just_written and (seal is None or not is_believed(seal)):
            require_harmless(path)
        if seal is None or just_proven:
            return OpenedHdf5(h5py.File(path, "r", locking="best-effort"), seal)
        return _opened_through_proof(path, seal)
    except (OSError, ValueError, RuntimeError, RunFileError) as error:
        is_hdf5 = _is_hdf5(path)
        if isinstance(error, RunFileError) and is_hdf5:
            raise
        if is_hdf5:
            raise RunFileError(
                f"{path} is cut short or damaged",
                advice="If its journal is still there, `daq-app recover` makes the run anew.",
            ) from error
        raise RunFileError(f"{path} is no HDF5 file", advice="Give a run file (.h5).") from error


def _opened_through_proof(path: Path, seal: Seal) -> OpenedHdf5:
    proven = ProvenFile(path, seal)
    try:
        return OpenedHdf5(h5py.File(proven, "r"), seal, proven)
    except BaseException:
        proven.close()
        raise


def _is_hdf5(path: Path) -> bool:
    """Whether the file begins as HDF5 does. Raises `RunFileError` where it cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(8) == b"\x89HDF\r\n\x1a\n"
    except OSError as error:
        raise RunFileError(f"{path} cannot be read ({error.strerror})", advice="Try again.") from error


@contextmanager
def damage_told(path: Path, what: str) -> Iterator[None]:
    """Whatever the HDF5 library throws at damaged bytes becomes one `RunFileError`."""
    try:
        yield
    except (OSError, KeyError, ValueError, TypeError, RuntimeError, OverflowError, MemoryError) as error:
        raise RunFileError(
            f"{path}: {what} is damaged",
            advice="If its journal is still there, `daq-app recover` makes the run anew.",
        ) from error


def checked_dataset(
    path: Path,
    group: h5py.Group,
    name: str,
    *,
    itemsize: int | None = None,
    length: int | None = None,
) -> h5py.Dataset:
    """A one-dimensional (or scalar) dataset that is safe to read. Raises `RunFileError`."""

    def refuse(why: str) -> RunFileError:
        return RunFileError(f"{path}: {group.name.rstrip('/')}/{name} {why}")

    # The plain calls below h5py's classes: a run has a hundred datasets, and each is asked all of this.
    octets = name.encode()
    if not group.id.__contains__(octets):
        raise refuse("is missing")
    if group.id.links.get_info(octets).type != h5py.h5l.TYPE_HARD:
        raise refuse("is a link to somewhere else, which a run never holds")
    opened = h5py.h5o.open(group.id, octets)
    shape = opened.shape if isinstance(opened, h5py.h5d.DatasetID) else None
    if shape is None or len(shape) > 1:
        raise refuse("is not a column of data")
    dtype = opened.dtype
    if itemsize is not None and (dtype.kind != "f" or dtype.itemsize != itemsize):
        raise refuse(f"holds {dtype}, not {8 * itemsize}-bit floating point numbers")
    if length is not None and shape != (length,):
        raise refuse(f"has shape {shape}, not ({length},)")
    why = _unsafe_storage(opened)
    if why:
        raise refuse(why)
    return h5py.Dataset(opened)


def _unsafe_storage(opened: h5py.h5d.DatasetID) -> str:
    """Why reading a dataset would reach beyond its file or fill the memory; empty where it would not."""
    creation, itemsize = opened.get_create_plist(), opened.dtype.itemsize
    kind = creation.get_layout()
    if kind == h5py.h5d.VIRTUAL or creation.get_external_count():
        return "takes its data from another file, which a run never does"
    filters = [creation.get_filter(index)[0] for index in range(creation.get_nfilters())]
    if not _FILTERS.issuperset(filters):
        return "uses an unknown compression"
    if math.prod(opened.shape) * itemsize > _MAX_DEFLATE_RATIO * opened.get_storage_size() + 2**16:
        return "claims more data than the file holds"
    chunks = creation.get_chunk() if kind == h5py.h5d.CHUNKED else ()
    if chunks and math.prod(chunks) * itemsize > _MAX_CHUNK_BYTES:
        return "has absurdly large chunks"
    return ""


def read_text(path: Path, group: h5py.Group, name: str) -> str:
    """A text stored as one string. Raises `RunFileError`."""
    dataset = checked_dataset(path, group, name)
    if dataset.shape != () or h5py.check_string_dtype(dataset.dtype) is None:
        raise RunFileError(f"{path}: {name} is not a text")
    value = dataset.asstr()[()]
    return str(value)


def read_column(path: Path, group: h5py.Group, name: str) -> list[Any]:
    """A column of a small table, as numbers or texts. Raises `RunFileError` if it is not small."""
    dataset = checked_dataset(path, group, name)
    if len(dataset.shape) != 1 or dataset.shape[0] > _MAX_ROWS:
        raise RunFileError(f"{path}: {group.name}/{name} is no table of a run")
    if h5py.check_string_dtype(dataset.dtype) is None:
        if dataset.dtype.kind not in "iuf":
            raise RunFileError(f"{path}: {group.name}/{name} is neither numbers nor texts")
        return list(dataset[()].tolist())
    texts: list[Any] = []
    budget = _MAX_TEXT_BYTES
    # Some at a time: many rows may point to one long text, and only a sum tells. No text is longer than
    # the file, so these fit into the budget whatever they are.
    some = max(1, _MAX_TEXT_BYTES // max(group.file.id.get_filesize(), 1))
    strings = dataset.asstr(errors="replace")
    for start in range(0, dataset.shape[0], some):
        read = strings[start : start + some].tolist()
        budget -= sum(map(len, read))
        if budget < 0:
            raise RunFileError(f"{path}: {group.name}/{name} is absurdly long")
        texts.extend(read)
    return texts

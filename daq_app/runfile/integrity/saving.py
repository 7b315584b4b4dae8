"""From the journal to the run file, so that at every moment one of the two is whole.

verify the journal → write ``RUN.h5.tmp`` → seal → flush → reopen and compare every sample → rename.
"""

from __future__ import annotations

import contextlib
import shutil
from pathlib import Path

import numpy as np

from daq_app.runfile import layout
from daq_app.runfile.durable import fsync_file, remove, replace_durably
from daq_app.runfile.errors import RunFileError
from daq_app.runfile.hdf5.chunks import chunk_samples
from daq_app.runfile.hdf5.read import open_run
from daq_app.runfile.hdf5.safe import open_hdf5
from daq_app.runfile.hdf5.write import write_run
from daq_app.runfile.journal.locks import journal_locked
from daq_app.runfile.journal.read import JournalContents, read_journal
from daq_app.runfile.model import DerivedData
from daq_app.runfile.source import Provenance, RunScaling, RunSource, rig_of

_FAULTY = "The disk or the memory of this machine is faulty; the journal is untouched."
_SIZE_FACTOR = 1.6
"""Room asked for: raw float64 and SI float32 uncompressed, and a little."""


def finalise(
    journal: Path, out: Path, derived: DerivedData | None = None, *, keep_journal: bool = True
) -> Path:
    """Make the run file of a closed journal and return `out`.

    The journal is left beside the run unless `keep_journal` is false; then it is removed once the run
    has its name, unless another program holds it.  If `out` is already the run of this journal nothing
    is done.  Raises `RunFileError` if the journal is still being written or holds no samples, if `out`
    is another run, or if the disk lacks room: the journal is untouched then.
    """
    with journal_locked(journal), read_journal(journal) as contents:
        finalise_contents(contents, out, derived)
    if not keep_journal:
        remove(journal)
    return out


def finalise_contents(contents: JournalContents, out: Path, derived: DerivedData | None = None) -> None:
    """`finalise` for a journal that is open already and whose lock is held."""
    if contents.n_samples == 0:
        raise RunFileError(f"{contents.path} holds no samples", advice="There is nothing to make a run of.")
    if out.exists():
        if not is_run_of(out, contents):
            raise RunFileError(f"{out} exists and is another run", advice="Choose another name.")
        return
    provenance = Provenance(contents.closed, tuple(contents.damage), contents.path.name, contents.file_bytes)
    save_run(contents, out, provenance, derived)


def save_run(
    source: RunSource, out: Path, provenance: Provenance, derived: DerivedData | None = None
) -> None:
    """Write a run through a temporary file, prove it sample by sample, and give it its name.

    Raises `RunFileError`; nothing is left behind then.
    """
    require_space(out.parent, int(_SIZE_FACTOR * 8 * source.n_samples * source.header.n_channels))
    temporary = out.with_name(out.name + ".tmp")
    try:
        write_run(temporary, source, provenance, derived)
        fsync_file(temporary)
        compare_run(temporary, source)
        replace_durably(temporary, out)
    except OSError as error:
        raise RunFileError(
            f"{out} cannot be written ({error.strerror or error})",
            advice="What it is made from is untouched; a journal becomes a run with `daq-app recover`.",
        ) from error
    finally:
        remove(temporary)


def require_space(folder: Path, n_bytes: int) -> None:
    """Raise `RunFileError` unless `folder` has room. HDF5 does not survive a full disk."""
    free = shutil.disk_usage(folder).free
    if free < n_bytes:
        raise RunFileError(
            f"{folder} has {free / 1e6:.0f} MB free and the run needs up to {n_bytes / 1e6:.0f} MB",
            advice="Free space on this disk and run `daq-app recover`; the journal is safe.",
        )


def compare_run(path: Path, source: RunSource) -> None:
    """Read the file back and compare every sample, bit by bit. Raises `RunFileError` at a difference."""
    try:
        _compare_samples(path, source)
        with open_run(path, just_written=True) as run:
            same_header = run.header.model_dump_json() == source.header.model_dump_json()
            same = same_header and (run.events, run.gaps) == (source.events, source.gaps)
    except (OSError, RunFileError) as error:
        raise RunFileError(f"{path} differs from what was written ({error})", advice=_FAULTY) from error
    if not same:
        raise RunFileError(f"{path}: events, gaps or header differ from the source", advice=_FAULTY)


def _compare_samples(path: Path, source: RunSource) -> None:
    header = source.header
    scaling = RunScaling.of(header, rig_of(header))
    chunk = chunk_samples(header.n_channels, source.n_samples)
    with contextlib.closing(open_hdf5(path, just_written=True)) as opened:
        raw, si = opened.file[layout.RAW], opened.file[layout.SI]
        pairs_raw = [(row, raw[channel_id]) for row, channel_id in enumerate(header.channel_ids)]
        pairs_si = [(row, si[channel_id]) for row, channel_id in enumerate(scaling.channels)]
        for first, window in source.windows(chunk):
            part = slice(first - source.first_sample, first - source.first_sample + window.shape[1])
            si_window = scaling.stored_si(window)
            same = all(
                np.array_equal(dataset[part].view(np.int64), window[row].view(np.int64))
                for row, dataset in pairs_raw
            ) and all(
                np.array_equal(dataset[part].view(np.int32), si_window[row].view(np.int32))
                for row, dataset in pairs_si
            )
            if not same:
                raise RunFileError(f"other samples near {first}")


def is_run_of(path: Path, contents: JournalContents) -> bool:
    """Whether a run file was made from this journal in its present state."""
    try:
        with open_run(path) as run:
            return (
                run.header.run_id == contents.header.run_id
                and run.first_sample == contents.first_sample
                and run.n_samples == contents.n_samples
                and run.attributes.source_bytes == contents.file_bytes
            )
    except RunFileError:
        return False

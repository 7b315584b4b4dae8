"""Says yes, or what is wrong, of a run, a journal, or a whole folder."""

from __future__ import annotations

import contextlib
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.folder import JOURNAL_SUFFIX, find_journals, find_runs
from daq_app.runfile.hdf5.chunks import chunk_samples
from daq_app.runfile.hdf5.copies import copy_problems
from daq_app.runfile.hdf5.read import Run, open_run
from daq_app.runfile.hdf5.write import combined_sha256
from daq_app.runfile.integrity.saving import is_run_of
from daq_app.runfile.journal.frames import MAGIC
from daq_app.runfile.journal.read import read_journal
from daq_app.runfile.seal.format import Seal
from daq_app.runfile.seal.proven_file import ProvenFile, seal_of
from daq_app.runfile.seal.signing import made_here, signature_is_good
from daq_app.runfile.seal.trust import trusted_as
from daq_app.runfile.source import RunScaling


@dataclass(frozen=True, slots=True)
class VerifyReport:
    """`ok` means: every sample is there and proven, or is listed as missing."""

    path: Path
    kind: Literal["run", "journal", "folder"]
    problems: tuple[str, ...] = ()
    """What is wrong, one sentence each; empty if `ok`."""
    notes: tuple[str, ...] = ()
    """What is not wrong but should be known (gaps, a recorder cut off)."""
    n_samples: int = 0
    lost_samples: int = 0
    duration_s: float = 0.0
    children: tuple[VerifyReport, ...] = ()
    proven: Literal["every byte", "readings", "frames", ""] = ""
    """What of the file stands under a checksum; empty where nothing could be read."""

    @property
    def ok(self) -> bool:
        return not self.problems and all(child.ok for child in self.children)


def verify(path: Path | str) -> VerifyReport:
    """Check a run (every sample), a journal (every frame) or all of them in a folder and below.

    Never raises for a bad file: the report says it. Raises `RunFileError` if `path` does not exist.
    """
    path = Path(path)
    if path.is_dir():
        return _verify_folder(path)
    if not path.exists():
        raise RunFileError(f"{path} does not exist", advice="Give a run, a journal, or their folder.")
    try:
        with path.open("rb") as file:
            looks_like_journal = file.read(len(MAGIC)) == MAGIC
    except OSError as error:
        return VerifyReport(path, "run", (f"{path} cannot be read ({error.strerror})",))
    if looks_like_journal or path.suffix == JOURNAL_SUFFIX:
        return _verify_journal(path)
    return verify_run(path)


def _verify_folder(folder: Path) -> VerifyReport:
    runs = find_runs(folder)
    journals = find_journals(folder)
    children = [verify_run(run) for run in runs] + [_verify_journal(journal) for journal in journals]
    problems = [
        f"{journal.name} has not been saved as a run: use `daq-app recover`"
        for journal in journals
        if not _has_run(journal, runs)
    ]
    notes = [] if children else [f"{folder} holds no run and no journal"]
    return VerifyReport(
        folder,
        "folder",
        tuple(problems),
        tuple(notes),
        sum(child.n_samples for child in children if child.kind == "run"),
        sum(child.lost_samples for child in children if child.kind == "run"),
        sum(child.duration_s for child in children if child.kind == "run"),
        tuple(children),
    )


def _has_run(journal: Path, runs: list[Path]) -> bool:
    try:
        with read_journal(journal) as contents:
            if contents.n_samples == 0:
                return True
            beside = [
                run for run in runs if run.parent == journal.parent and run.stem.startswith(journal.stem)
            ]
            return any(is_run_of(run, contents) for run in beside)
    except RunFileError:
        return True  # its own report says what is wrong with it


def _verify_journal(path: Path) -> VerifyReport:
    try:
        with read_journal(path) as contents:
            notes = []
            if not contents.closed:
                notes.append("it was not closed: it is being recorded, or the recorder was cut off")
            if contents.ends_in_torn_frame:
                notes.append(
                    f"its last {contents.tail_bytes} bytes are an unfinished frame: up to "
                    f"{contents.tail_samples} samples of each channel were being written"
                )
            notes += _gap_note(contents.lost_samples, len(contents.gaps))
            return VerifyReport(
                path,
                "journal",
                tuple(contents.damage),
                tuple(notes),
                contents.n_samples,
                contents.lost_samples,
                contents.n_samples / contents.header.rate_hz,
                proven="frames",
            )
    except RunFileError as error:
        return VerifyReport(path, "journal", (str(error),))


def verify_run(path: Path) -> VerifyReport:
    """Check every byte and every sample of a run file. Never raises for a bad file."""
    problems: list[str] = []
    notes: list[str] = []
    try:
        seal = seal_of(path)
        if seal is not None:
            problems, notes = _seal_findings(path, seal)
        if problems:
            return VerifyReport(path, "run", tuple(problems), tuple(notes))
        with open_run(path, just_proven=seal is not None) as run:
            problems = [*_table_problems(run), *_sample_problems(run)]
            if seal is None:
                problems += copy_problems(run)
                notes.append(_UNSEALED)
            notes += _gap_note(run.attributes.lost_samples, len(run.gaps))
            if not run.attributes.closed_in_good_order:
                notes.append("it was recovered: the recorder had been cut off")
            notes += [f"its journal was damaged: {line}" for line in run.attributes.damage.splitlines()]
            if run.rig is None:
                notes.append("it holds no rig that this version understands: no engineering units")
            return VerifyReport(
                path,
                "run",
                tuple(problems),
                tuple(notes),
                run.n_samples,
                run.attributes.lost_samples,
                run.n_samples / run.rate_hz,
                proven="readings" if seal is None else "every byte",
            )
    except RunFileError as error:
        return VerifyReport(path, "run", (*problems, str(error)), tuple(notes))
    except OSError as error:
        return VerifyReport(path, "run", (f"{path} cannot be read ({error.strerror or error})",))


_UNSEALED: Final = (
    "it has no seal (format version 1): its readings are proven, and what is stored twice agrees; that "
    "nothing else in it was changed (events, notes, derived signals) cannot be told"
)


def _seal_findings(path: Path, seal: Seal) -> tuple[list[str], list[str]]:
    """Problems and notes on the bytes of a sealed file."""
    with contextlib.closing(ProvenFile(path, seal)) as proven:
        ranges = proven.damaged_ranges()
    if ranges:
        where = ", ".join(f"{start} to {end}" for start, end in ranges[:4]) + (
            " …" if len(ranges) > 4 else ""
        )
        return [
            f"its bytes {where} are not the ones that were saved (SHA-256): it was damaged or changed"
        ], []
    if not seal.signature:
        return [], [
            "its seal is not signed: it proves against damage, not against somebody who edits the file"
        ]
    if not signature_is_good(seal):
        return ["the signature of its seal is wrong: somebody changed the file and made a new seal"], []
    if made_here(seal):
        return [], []
    name = trusted_as(seal)
    if name is not None:
        return [], [f"it was sealed by the trusted recorder {name}"]
    return [], [
        f"it was sealed by a recorder that is not trusted here, key {seal.public_key.hex()} "
        "(`daq-app keys trust NAME KEY`, once the key is known to be right)"
    ]


def _gap_note(lost: int, gaps: int) -> list[str]:
    return [f"{lost} samples per channel are missing, in {gaps} gaps"] if gaps else []


def _table_problems(run: Run) -> list[str]:
    problems = []
    position = run.first_sample
    end = run.first_sample + run.n_samples
    for gap in run.gaps:
        if gap.n_samples <= 0 or gap.first_sample < position or gap.end > end:
            problems.append(f"the gap at sample {gap.first_sample} does not fit into the run")
            return problems
        position = gap.end
    if sum(gap.n_samples for gap in run.gaps) != run.attributes.lost_samples:
        problems.append("the table of gaps and the number of lost samples contradict each other")
    return problems


def _sample_problems(run: Run) -> list[str]:
    """Every chunk is read (its checksum is proven), hashed, and compared with gaps and engineering units."""
    scaling = RunScaling.of(run.header, run.rig)
    digests = [hashlib.sha256() for _ in run.channel_ids]
    problems: list[str] = []
    scaled_wrong: set[str] = set()
    chunk = chunk_samples(run.header.n_channels, run.n_samples)
    gaps_wrong = False
    for start in range(0, run.n_samples, chunk):
        stop = min(start + chunk, run.n_samples)
        window = run.readings(start=start, stop=stop)
        for digest, row in zip(digests, window, strict=True):
            digest.update(np.ascontiguousarray(row).data)
        missing = _missing(run, start, stop)
        gaps_wrong |= not bool(np.isnan(window[:, missing]).all())
        si = scaling.stored_si(window)
        for index, channel_id in enumerate(scaling.channels):
            stored = run.stored_si(channel_id, start, stop)
            if stored is None or not np.array_equal(stored, si[index], equal_nan=True):
                scaled_wrong.add(channel_id)
    hashes = [digest.hexdigest() for digest in digests]
    changed = [
        channel_id
        for channel_id, value in zip(run.channel_ids, hashes, strict=True)
        if value != run.stored_sha256(channel_id)
    ]
    if changed:
        problems.append(f"the readings of {', '.join(changed)} are not the ones that were recorded (SHA-256)")
    elif combined_sha256(hashes) != run.attributes.raw_sha256:
        problems.append("the hash over all channels is wrong")
    if gaps_wrong:
        problems.append("there are readings where the table of gaps says there are none")
    if scaled_wrong:
        names = ", ".join(sorted(scaled_wrong))
        problems.append(f"the engineering units of {names} do not follow from readings and scaling")
    return problems


def _missing(run: Run, start: int, stop: int) -> NDArray[np.bool_]:
    missing = np.zeros(stop - start, dtype=np.bool_)
    for gap in run.gaps:
        low = max(gap.first_sample - run.first_sample - start, 0)
        high = min(gap.end - run.first_sample - start, stop - start)
        if low < high:
            missing[low:high] = True
    return missing

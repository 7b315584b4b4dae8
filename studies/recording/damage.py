"""``python -m studies.recording.damage --count 5000``: random damage of runs and journals, judged by others.

A sound file is damaged (a bit, a byte, a page, a cut, blocks that are repeated, exchanged or left out), half
of the time anywhere and half of the time in its metadata, and `verify` is asked in a process of its own.
Found would be: "good" with another content than the sound file's, a crash, more than 10 s, or more than
300 MB.

Who judges is not `verify`: a sealed run is another content if a byte differs; a run of format version 1 is
read by plain h5py; a journal by ``docs/reference/journal_reader.py``.  A journal that was cut within one
frame looks like one whose recorder died: it may be called good if that is said, and what is left is the
beginning.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import random
import runpy
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Final

import h5py
import numpy as np
import psutil

from daq_app.config import load_rig
from daq_app.runfile import DerivedData, DerivedSignal, JournalWriter, RunHeader, finalise, verify
from daq_app.runfile.seal.format import MAGIC

REPOSITORY: Final = Path(__file__).parents[2]
RIG: Final = REPOSITORY / "configs" / "fr1.toml"
LIMIT_S, LIMIT_BYTES = 10.0, 300 * 2**20
KINDS: Final = ("run", "version 1", "journal")
PAGE: Final = 4096


def make_sound(folder: Path) -> dict[str, Path]:
    """A run of 41 channels with events, a gap, derived signals; the same as version 1; its journal."""
    rig = load_rig(RIG)
    header = RunHeader(
        run_id="20240102-FR1-L3-2",
        test="FR1-L3-2",
        specimen="FR1",
        rig_name=rig.name,
        rig_text=RIG.read_text(encoding="utf-8"),
        channel_ids=rig.channel_ids,
        reading_units=tuple(channel.reading_unit for channel in rig.channels),
        rate_hz=4000.0,
        tare={"WP-1": 0.25},
        start_utc_ns=1_704_187_800_000_000_000,
        truth={"r": 0.9, "seed": 4},
    )
    rng = np.random.default_rng(2)
    journal = folder / "sound.journal"
    with JournalWriter(journal, header) as writer:
        for first in range(0, 2400, 400):
            writer.append_event("state", first, f"armed, θ at sample {first}", {"theta": 0.07})
            readings = np.round(rng.normal(size=(len(rig.channels), 400)) / 3e-4) * 3e-4
            writer.append_block(first, readings)
        writer.append_gap(2400, 100, "the chassis was off the network")
        writer.append_block(2500, np.ones((len(rig.channels), 400)))
    results = {"quality": {"verdict": "good", "reasons": ["a", "b"]}, "r": 0.9}
    derived = DerivedData(0, {"rotation": DerivedSignal(np.arange(700.0), "rad", "rotation")}, 1, results)
    run = finalise(journal, folder / "sound.h5", derived)
    old = folder / "old.h5"
    old.write_bytes(run.read_bytes())
    with h5py.File(old, "r+") as file:
        del file["integrity"]
        file.attrs["format_version"] = 1
    old.write_bytes(old.read_bytes().replace(MAGIC, bytes(len(MAGIC))))
    return {"run": run, "version 1": old, "journal": journal}


def metadata_ranges(kind: str, path: Path) -> list[tuple[int, int]]:
    """Byte ranges that hold no readings."""
    size = path.stat().st_size
    held: list[tuple[int, int]] = []
    if kind == "journal":
        content, at = path.read_bytes(), 0
        while at < size:
            n_bytes = int.from_bytes(content[at + 44 : at + 48], "little")
            if int.from_bytes(content[at + 10 : at + 12], "little") == 2:
                held.append((at + 56, at + 56 + n_bytes))
            at += 56 + n_bytes
    else:
        with h5py.File(path) as file:
            for name in ("raw", "si", "derived"):
                for dataset in file[name].values():
                    if isinstance(dataset, h5py.Dataset) and dataset.chunks:
                        chunks = map(dataset.id.get_chunk_info, range(dataset.id.get_num_chunks()))
                        held += [(chunk.byte_offset, chunk.byte_offset + chunk.size) for chunk in chunks]
    free, position = [], 0
    for start, end in [*sorted(held), (size, size)]:
        if start > position:
            free.append((position, start))
        position = max(position, end)
    return free


def damaged(sound: bytes, metadata: list[tuple[int, int]], rng: random.Random) -> tuple[bytes, str]:
    """(the damaged bytes, what was done)."""
    if rng.random() < 0.5:
        start, end = rng.choices(metadata, [high - low for low, high in metadata])[0]
        at = rng.randrange(start, end)
    else:
        at = rng.randrange(len(sound))
    page = at - at % PAGE
    block = rng.choice((64, 512, PAGE))
    other = rng.randrange(len(sound))
    what = rng.choice(("bit", "zero page", "noise page", "cut", "repeated", "exchanged", "left out", "byte"))
    out = bytearray(sound)
    if what == "bit":
        out[at] ^= 1 << rng.randrange(8)
    elif what == "byte":
        out[at] = rng.randrange(256)
    elif what == "zero page":
        out[page : page + PAGE] = bytes(len(out[page : page + PAGE]))
    elif what == "noise page":
        out[page : page + PAGE] = rng.randbytes(len(out[page : page + PAGE]))
    elif what == "cut":
        del out[at:]
    elif what == "repeated":
        out[at:at] = out[at : at + block]
    elif what == "left out":
        del out[at : at + block]
    else:
        here, there = sound[at : at + block], sound[other : other + block]
        length = min(len(here), len(there))
        out[at : at + length], out[other : other + length] = there[:length], here[:length]
    return bytes(out), what


def content_of(kind: str, path: Path) -> str:
    """Hash of what a reader that is not ours makes of a file; for a sealed run, of its bytes."""
    digest = hashlib.sha256()
    if kind == "run":
        digest.update(path.read_bytes())
    elif kind == "journal":
        read = runpy.run_path(str(REPOSITORY / "docs" / "reference" / "journal_reader.py"))["read_journal"]
        digest.update(repr(read(path)).encode())
    else:
        try:
            with h5py.File(path) as file:
                for line in _described(file):
                    digest.update(line)
        except (OSError, RuntimeError, KeyError) as error:
            return f"cannot be read: {error}"
    return digest.hexdigest()


def _is_beginning(part: Path, whole: Path) -> bool:
    """Whether what an independent reader finds in a journal is the beginning of what it finds in another."""
    read = runpy.run_path(str(REPOSITORY / "docs" / "reference" / "journal_reader.py"))["read_journal"]
    pairs = zip(read(part), read(whole), strict=True)
    return all(
        left == right if isinstance(left, dict) else left == right[: len(left)] for left, right in pairs
    )


def _described(group: h5py.Group) -> Iterator[bytes]:
    for name in sorted(group.attrs):
        if not name.startswith(("REFERENCE_LIST", "DIMENSION_LIST", "_Netcdf4")):
            yield f"{group.name}@{name}={np.asarray(group.attrs[name]).tolist()!r}".encode()
    for name in sorted(group) if isinstance(group, h5py.Group) else ():
        item = group[name]
        yield from _described(item)
        if isinstance(item, h5py.Dataset):
            value = np.asarray(item[()])
            yield item.name.encode() + (
                repr(value.tolist()).encode() if value.dtype == object else value.tobytes()
            )


def work(folder: Path) -> None:
    """Worker: one path a line on standard input, the verdict of `verify` a line on standard output."""
    for line in sys.stdin:
        report = verify(Path(json.loads(line)))
        cut_off = any("not closed" in note for note in report.notes)
        print(json.dumps({"good": report.ok, "cut off": cut_off}), flush=True)


class Judge:
    """A worker that verifies, watched for time and memory with all of its children."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.most_bytes = 0
        self.longest_s = 0.0
        self._start()

    def _start(self) -> None:
        command = [sys.executable, "-m", "studies.recording.damage", "--worker", str(self._folder)]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=REPOSITORY
        )
        self._answers: SimpleQueue[str] = SimpleQueue()
        threading.Thread(target=self._listen, args=(self._process, self._answers), daemon=True).start()

    @staticmethod
    def _listen(process: subprocess.Popen[str], answers: SimpleQueue[str]) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            answers.put(line)
        answers.put("")

    def ask(self, path: Path) -> dict[str, Any] | str:
        """What `verify` says, or what became of the process."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(str(path)) + "\n")
        self._process.stdin.flush()
        begun_s = time.monotonic()
        trouble = ""
        while True:
            with contextlib.suppress(Empty):
                line = self._answers.get(timeout=0.02)
                took_s = time.monotonic() - begun_s
                self.longest_s = max(self.longest_s, took_s)
                if not line:
                    self._start()
                    return "crash"
                if trouble:
                    return trouble
                return dict(json.loads(line))
            n_bytes = self._memory()
            self.most_bytes = max(self.most_bytes, n_bytes)
            if n_bytes > LIMIT_BYTES:
                trouble = "memory"
            if time.monotonic() - begun_s > LIMIT_S:
                trouble = "slow"
            if time.monotonic() - begun_s > 6 * LIMIT_S:
                self.close()
                self._start()
                return "hang"

    def _memory(self) -> int:
        """Memory of the largest process: the verifying one or the child that walks through files for it."""
        sizes = [0]
        with contextlib.suppress(psutil.Error):
            process = psutil.Process(self._process.pid)
            for one in (process, *process.children()):
                with contextlib.suppress(psutil.Error):
                    sizes.append(one.memory_info().rss)
        return max(sizes)

    def close(self) -> None:
        """End the worker."""
        self._process.kill()
        self._process.wait()


def study(kind: str, count: int, seed: int, folder: Path) -> dict[str, Any]:
    """Damage a file `count` times."""
    path = make_sound(folder)[kind]
    sound, metadata, wanted = path.read_bytes(), metadata_ranges(kind, path), content_of(kind, path)
    rng = random.Random(seed)
    case = folder / f"case{path.suffix}"
    case.write_bytes(sound)
    judge = Judge(folder)
    outcomes: Counter[str] = Counter()
    found: list[str] = []
    first = judge.ask(case)  # loads the program, which is no file's fault
    if first != "slow" and not (isinstance(first, dict) and first["good"]):
        raise RuntimeError(f"the sound file is not called good: {first}")
    judge.longest_s = 0.0
    for number in range(count):
        content, what = damaged(sound, metadata, rng)
        if content == sound:
            outcomes["unchanged"] += 1
            continue
        case.write_bytes(content)
        answer = judge.ask(case)
        if isinstance(answer, str):
            outcomes[answer] += 1
            found.append(f"{number}: {what}: {answer}")
        elif not answer["good"]:
            outcomes["found"] += 1
        elif content_of(kind, case) == wanted:
            outcomes["good, and its content is the same"] += 1
        elif kind == "journal" and answer["cut off"] and _is_beginning(case, path):
            outcomes["good, cut off and says so"] += 1
        else:
            outcomes["good, and its content is another"] += 1
            found.append(f"{number}: {what}: good, and its content is another")
        if number % 500 == 499:
            print(f"{kind}: {number + 1}: {dict(outcomes)}", flush=True)
    judge.close()
    return {
        "kind": kind,
        "count": count,
        "seed": seed,
        "bytes": len(sound),
        "metadata_share": sum(end - start for start, end in metadata) / len(sound),
        "outcomes": dict(outcomes),
        "longest_s": judge.longest_s,
        "most_mb": judge.most_bytes / 2**20,
        "found": found[:50],
    }


def main() -> int:
    """0 if nothing was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--count", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=KINDS, action="append")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--worker", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        work(options.worker)
        return 0
    reports = []
    for kind in options.kind or KINDS:
        with tempfile.TemporaryDirectory(prefix="damage-") as name:
            reports.append(study(kind, options.count, options.seed, Path(name)))
        report = reports[-1]
        print(f"{kind}: {options.count} damages, seed {options.seed}: {report['outcomes']}")
        print(f"  longest {report['longest_s']:.1f} s, most memory {report['most_mb']:.0f} MB")
        for line in report["found"][:10]:
            print(f"  {line}")
    if options.json:
        options.json.write_text(json.dumps(reports, indent=1), encoding="utf-8")
    return 1 if any(report["found"] for report in reports) else 0


if __name__ == "__main__":
    sys.exit(main())

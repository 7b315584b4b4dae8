"""Throws damaged files at everything that reads files, for as long as it is told.

    python -m studies.recording.fuzz_files --minutes 10 [--kind mat] [--seed 1]

Not collected by pytest (it takes minutes). A worker process reads file after file; what counts as found is a
crash of the interpreter, an exception other than `RunFileError`, more than a gigabyte of memory, more than
a minute for one file, or a file left in the folder of runs. Found files are kept in ``fuzz-found/``.
"""

from __future__ import annotations

import argparse
import contextlib
import random
import shutil
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
import psutil

from daq_app.config import Rig, load_rig
from daq_app.runfile import JournalWriter, RunFileError, RunHeader, finalise, open_run, recover, verify
from daq_app.runfile.exporters import FORMATS, export_run
from daq_app.runfile.importers import ImportMap, import_file

REPOSITORY = Path(__file__).parents[2]
RIG = REPOSITORY / "configs" / "fr1.toml"
LEGACY = REPOSITORY.parent / "shared" / "data" / "legacy"
MAX_SECONDS, MAX_BYTES = 60.0, 2**30
START_SECONDS = 300.0
"""For a worker to load the program, on a busy machine."""
KINDS = ("run", "journal", "tdms", "mat", "npz", "csv", "lvm")
LVM = (
    "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t,\nMulti_Headings\tYes\nX_Columns\tOne\n"
    "***End_of_Header***\t\n\t\nChannels\t2\nSamples\t3\t3\nDate\t2024/01/02\t2024/01/02\nTime\t10:00:00,5\n"
    "Y_Unit_Label\t\tVolts\tmV\nDelta_X\t\t0,01\t0,01\n***End_of_Header***\t\nX_Value\tWP-1\tWP-2\tComment\n"
    "0,00\t1,5\t10\n0,01\t\t20\tdoor\n0,02\t2,5\n"
)


def seeds(folder: Path, rig: Rig) -> dict[str, list[bytes]]:
    """Sound files of each kind, small."""
    ids = ("LV-A01", "WP-1", "AC-1", "TL-1X")
    units = tuple(rig.channel(channel_id).reading_unit for channel_id in ids)
    header = RunHeader(
        run_id="fuzz",
        rig_text=RIG.read_text(encoding="utf-8"),
        channel_ids=ids,
        reading_units=units,
        rate_hz=4000,
    )
    journal = folder / "seed.journal"
    with JournalWriter(journal, header) as writer:
        writer.append_block(0, np.random.default_rng(0).normal(size=(4, 200)))
        writer.append_gap(200, 20, "gap")
        writer.append_event("marker", 10, "text", {"a": 1})
        writer.append_block(220, np.ones((4, 100)))
    run = finalise(journal, folder / "seed.h5")
    found = {"run": [run.read_bytes()], "journal": [journal.read_bytes()], "lvm": [LVM.encode()]}
    for kind in ("tdms", "mat", "npz", "csv"):
        found[kind] = [export_run(run, folder, kind).read_bytes()]
    for path in sorted(LEGACY.glob("*")) if LEGACY.is_dir() else ():
        found.setdefault(path.suffix[1:], []).append(path.read_bytes()[:60_000])
    return found


def damaged(data: bytes, rng: random.Random) -> bytes:
    """One to six small things that go wrong; numbers that mean sizes are favoured."""
    out = bytearray(data)
    for _ in range(rng.randint(1, 6)):
        if not out:
            return bytes(out)
        at = rng.randrange(len(out))
        match rng.randrange(7):
            case 0:
                out[at] ^= 1 << rng.randrange(8)
            case 1:
                out[at] = rng.randrange(256)
            case 2:
                value = rng.choice((0, 1, 0x7FFFFFFF, 0xFFFFFFFF, 0x80000000, rng.randrange(2**32)))
                out[at : at + 4] = value.to_bytes(4, rng.choice(("little", "big")))
            case 3:
                out[at : at + 8] = rng.choice((2**63 - 1, 2**64 - 1, 2**40)).to_bytes(8, "little")
            case 4:
                del out[at : at + rng.randint(1, 64)]
            case 5:
                out[at:at] = out[rng.randrange(len(out)) :][: rng.randint(1, 64)]
            case 6:
                del out[at:]
    return bytes(out)


def read(kind: str, path: Path, rig: Rig, text: str, runs: Path) -> None:
    """What the program does with such a file."""
    if kind == "run":
        verify(path)
        with open_run(path) as run:
            run.readings()
            _ = run.derived
    elif kind == "journal":
        verify(path)
        recover(path)
    else:
        names = {"from": "WP-1", "unit": "V"}
        maps: list[dict[str, object]] = [{}, {"channels": {"WP-1": names}, "source": {"rate_hz": 1000.0}}]
        for number, import_map in enumerate(maps):
            try:
                import_file(path, rig, text, runs / f"{number}.h5", ImportMap.model_validate(import_map))
            except RunFileError:
                if list(runs.iterdir()):
                    raise AssertionError("something was left behind") from None
            for made in runs.iterdir():
                made.unlink()


def work(kind: str, seed: int, folder: Path) -> None:
    """Worker: one damaged file after another; each number is printed before its file is read."""
    warnings.simplefilter("ignore")
    rig, text = load_rig(RIG), RIG.read_text(encoding="utf-8")
    runs = folder / "runs"
    runs.mkdir()
    sound = seeds(folder, rig)[kind]
    suffix = {"run": ".h5", "journal": ".journal"}.get(kind) or FORMATS.get(kind, f".{kind}")
    while True:
        rng = random.Random(seed)
        path = folder / f"case{suffix}"
        path.write_bytes(damaged(rng.choice(sound), rng))
        print(seed, flush=True)
        try:
            read(kind, path, rig, text, runs)
        except RunFileError:
            pass
        except BaseException as error:
            print(f"found {type(error).__name__}: {error}", flush=True)
        for left in folder.glob("case*.h5*"):
            if left != path:
                left.unlink()
        seed += 1


def watch(kind: str, seed: int, minutes: float) -> tuple[int, list[str]]:
    """Run workers of one kind for a time; returns the number of files and what was found."""
    until = time.monotonic() + 60 * minutes
    files, found = 0, []
    while time.monotonic() < until:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            command = [sys.executable, __file__, "--worker", name, "--kind", kind, "--seed", str(seed)]
            log = folder / "log"
            with log.open("w") as output:
                worker = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
            process = psutil.Process(worker.pid)
            seen, since, why = "", time.monotonic(), ""
            while not why and time.monotonic() < until and worker.poll() is None:
                # Its end is awaited; that it hangs or swells, nobody tells: looked at in between.
                with contextlib.suppress(subprocess.TimeoutExpired):
                    worker.wait(0.2)
                now = log.read_text(errors="replace")
                if now != seen:
                    seen, since = now, time.monotonic()
                allowed = MAX_SECONDS if seen else START_SECONDS
                if time.monotonic() - since > allowed:
                    why = "hangs"
                elif process.is_running() and process.memory_info().rss > MAX_BYTES:
                    why = "memory"
            if worker.poll() not in (None, 0):
                why = f"exit code {worker.returncode}"
            worker.kill()
            worker.wait()
            lines = log.read_text(errors="replace").splitlines()
            numbers = [int(line) for line in lines if line.isdigit()]
            found += [f"{kind}: {line}" for line in lines if line.startswith("found")]
            files += len(numbers)
            seed = numbers[-1] + 1 if numbers else seed + 1
            if why:
                found.append(f"{kind} seed {seed - 1}: {why}")
                keep = REPOSITORY / "fuzz-found"
                keep.mkdir(exist_ok=True)
                for case in folder.glob("case.*"):
                    shutil.copy(case, keep / f"{kind}-{seed - 1}{case.suffix}")
    return files, found


def main() -> int:
    """0 if nothing was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0, help="for each kind")
    parser.add_argument("--kind", choices=KINDS, action="append")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--worker", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        work(options.kind[0], options.seed, options.worker)
    total: list[str] = []
    for kind in options.kind or KINDS:
        files, found = watch(kind, options.seed, options.minutes)
        print(f"{kind}: {files} files in {options.minutes:g} min, {len(found)} findings", flush=True)
        for line in found[:20]:
            print(f"  {line}", flush=True)
        total += found
    return 1 if total else 0


if __name__ == "__main__":
    sys.exit(main())

"""The disk fills up while a file grows: nothing crashes, nothing half-written stays, what was there stays.

A limit on the size of files stands for the full disk: the system then refuses writes in the same places, in
the midst of a frame or of HDF5's own bookkeeping.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

_SCRIPT = """
import json, resource, sys
from pathlib import Path
import numpy as np
from daq_app.config import load_rig
from daq_app.runfile import JournalDiskFull, JournalWriter, RunFileError, RunHeader, finalise, verify
from daq_app.runfile.exporters import FORMATS, export_run
from daq_app.runfile.importers import import_file

sys.dont_write_bytecode = True  # a limit would cut it short, and no program could import that module again
folder, rig_file = Path(sys.argv[1]), Path(sys.argv[2])
rig, text = load_rig(rig_file), rig_file.read_text(encoding="utf-8")
answers = {}

def limited(name, size, action):
    before = sorted(p.name for p in folder.iterdir())
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
    try:
        answer = repr(action())
    except RunFileError as error:
        answer = "told: " + str(error)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    left = sorted(set(p.name for p in folder.iterdir()) - set(before))
    answers[name] = [answer, left]

ids = rig.channel_ids[::7]
units = tuple(rig.channel(channel_id).reading_unit for channel_id in ids)
header = RunHeader(run_id="r", rig_text=text, channel_ids=ids, reading_units=units, rate_hz=4000.0)
block = np.random.default_rng(1).normal(size=(len(ids), 2000))

writer = JournalWriter(folder / "a.journal", header)
resource.setrlimit(resource.RLIMIT_FSIZE, (writer.size_bytes + 300_000, resource.RLIM_INFINITY))
for number in range(5):
    try:
        writer.append_block(2000 * number, block)
        writer.sync()
    except JournalDiskFull as error:
        answers["journal"] = [error.safe_sample, number, str(error)]
        break
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
for again in range(number, 10):
    writer.append_block(2000 * again, block)
writer.close()
answers["journal after"] = list(verify(folder / "a.journal").problems)

run = finalise(folder / "a.journal", folder / "a.h5")
size = run.stat().st_size
for part in (0.001, 0.01, 0.3, 0.9, 0.999):
    limited(f"finalise {part}", int(size * part), lambda: finalise(folder / "a.journal", folder / "b.h5"))
for format_ in FORMATS:
    limited(f"export {format_}", 50_000, lambda: export_run(run, folder, format_))
csv = export_run(run, folder, "csv", units="raw")
limited("import spool", 5_000, lambda: import_file(csv, rig, text, folder / "c.h5"))
limited("import save", 70_000, lambda: import_file(csv, rig, text, folder / "c.h5"))
answers["sound"] = verify(run).ok
print(json.dumps(answers))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit on the size of files")
def test_a_disk_that_fills_up_at_any_moment(tmp_path: Path, configs: Path) -> None:
    command = [sys.executable, "-c", _SCRIPT, str(tmp_path), str(configs / "fr1.toml")]
    process = subprocess.run(command, capture_output=True, text=True)
    assert process.returncode == 0, process.stderr[-2000:]
    answers = json.loads(process.stdout)
    safe, failed_block, sentence = answers.pop("journal")
    assert safe == 2000 * failed_block and "the disk is full; safe on disk up to sample" in sentence
    assert answers.pop("journal after") == []
    assert answers.pop("sound") is True
    assert len(answers) == 13
    for name, (answer, left) in answers.items():
        assert answer.startswith("told: ") and "File too large" in answer, (name, answer)
        assert left == [], (name, left)

"""The recorder, the saving and the recovery die at any moment, or the machine does."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from daq_app.runfile import JournalWriter, RunHeader, open_run, recover, verify
from tests.support.recorder.power_loss import one_trial

BLOCK = 40
CHANNELS = 8

_COMMON = f"""
import os, sys
import numpy as np
from pathlib import Path
from daq_app.runfile import JournalWriter, RunHeader, finalise, recover
import daq_app.runfile.integrity.saving as f
BLOCK, CHANNELS = {BLOCK}, {CHANNELS}
header = RunHeader(run_id="r", channel_ids=tuple("abcdefgh"), reading_units=("V",) * 8, rate_hz=4000.0)
def truth(samples):
    return samples[None, :] * 0.5 + np.arange(CHANNELS)[:, None] * 1e6
def block(first):
    return truth(np.arange(first, first + BLOCK))
folder = Path(sys.argv[1])
"""

_WRITER = (
    _COMMON
    + """
writer = JournalWriter(folder / "run.journal", header)
first = 0
while True:
    writer.append_block(first, block(first))
    first += BLOCK
    if first % (10 * BLOCK) == 0:
        writer.sync()
    os.write(1, b"%d\\n" % first)
"""
)


def truth(samples: np.ndarray) -> np.ndarray:
    return samples[None, :] * 0.5 + np.arange(CHANNELS)[:, None] * 1e6


def script(text: str, folder: Path, *more: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-c", text, str(folder), *more], stdout=subprocess.PIPE)


@pytest.mark.parametrize("lines", [1, 37, 1999])
def test_killed_recorder_loses_nothing_it_had_written(tmp_path: Path, lines: int) -> None:
    process = script(_WRITER, tmp_path)
    assert process.stdout is not None
    for _ in range(lines):
        written = int(process.stdout.readline())
    process.kill()
    rest = process.stdout.read().split(b"\n")
    process.wait()
    written = max([written] + [int(line) for line in rest[:-1]])
    (result,) = recover(tmp_path)
    assert result.outcome == "recovered" and "cut off" in result.text
    with open_run(tmp_path / "run.h5") as run:
        assert run.n_samples >= written and not run.gaps
        np.testing.assert_array_equal(run.readings(), truth(np.arange(run.n_samples)))
    assert verify(tmp_path).ok


_STEPS = {
    "while writing": "f.write_run = lambda path, *rest: (path.write_bytes(b'half'), os._exit(9))",
    "before the comparison": "f.compare_run = lambda *rest: os._exit(9)",
    "before the rename": "f.replace_durably = lambda *rest: os._exit(9)",
    "after the rename": """
real = f.replace_durably
f.replace_durably = lambda *names: (real(*names), os._exit(9))
""",
}


@pytest.mark.parametrize("step", _STEPS)
def test_saving_interrupted_anywhere_is_made_good(tmp_path: Path, step: str) -> None:
    text = (
        _COMMON
        + _STEPS[step]
        + """
with JournalWriter(folder / "run.journal", header) as writer:
    writer.append_block(0, block(0))
finalise(folder / "run.journal", folder / "run.h5")
"""
    )
    assert script(text, tmp_path).wait() == 9
    recover(tmp_path)
    with open_run(tmp_path / "run.h5") as run:
        np.testing.assert_array_equal(run.readings(), truth(np.arange(BLOCK)))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.h5", "run.journal"]


def test_two_recoveries_at_once_make_one_sound_run(tmp_path: Path) -> None:
    header = RunHeader(run_id="r", channel_ids=tuple("abcdefgh"), reading_units=("V",) * 8, rate_hz=4000.0)
    for number in range(4):
        with JournalWriter(tmp_path / f"{number}.journal", header) as writer:
            writer.append_block(0, truth(np.arange(5000)))
    processes = [script(_COMMON + "for r in recover(folder): print(r.outcome)", tmp_path) for _ in range(2)]
    outcomes = [process.communicate()[0].decode().splitlines() for process in processes]
    assert all(process.returncode == 0 for process in processes)
    for of_one_journal in zip(*outcomes, strict=True):
        assert of_one_journal.count("recovered") == 1
        assert set(of_one_journal) <= {"recovered", "saved already", "in use"}
    assert verify(tmp_path).ok
    assert len(list(tmp_path.iterdir())) == 8


def test_power_loss_damages_nothing_silently(tmp_path: Path) -> None:
    """100 trials at 10 flushes a second: nothing wrong, nothing acknowledged lost, at most 0.2 s in all."""
    rng = np.random.default_rng(11)
    trials = [one_trial(tmp_path, rng) for _ in range(100)]
    assert not [trial for trial in trials if trial.silent_damage]
    assert max(trial.lost_s for trial in trials) <= 0.2
    torn = sum(trial.acknowledged < trial.good < trial.written for trial in trials)
    assert torn > 10  # the trials really did tear frames

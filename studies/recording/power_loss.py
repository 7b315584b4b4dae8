"""``python -m studies.recording.power_loss --trials 100``: power is lost while a journal is written.

Prints how much was lost at most and whether anything was wrong silently.
`tests.support.recorder.power_loss` says what is modelled. The exit code is 0 without silent damage and with
at most 0.2 s lost.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

from tests.support.recorder.power_loss import one_trial


def main() -> int:
    """Run the trials and print what was lost."""
    parser = argparse.ArgumentParser(prog="python -m studies.recording.power_loss", description=__doc__)
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--seed", type=int, default=11)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    with tempfile.TemporaryDirectory() as name:
        trials = [one_trial(Path(name), rng) for _ in range(options.trials)]
    damaged = sum(trial.silent_damage for trial in trials)
    most_s = max(trial.lost_s for trial in trials)
    torn = sum(trial.acknowledged < trial.good < trial.written for trial in trials)
    print(
        f"{len(trials)} losses of power: silent damage in {damaged}; most lost {most_s:.3f} s of 0.2 s; "
        f"{torn} tore what was not flushed (seed {options.seed})"
    )
    return 0 if damaged == 0 and most_s <= 0.2 else 1


if __name__ == "__main__":
    sys.exit(main())

"""A run made without real time: the same samples, header, journal and run file as a recorded test."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np

from daq_app.acquisition.derive import derive
from daq_app.acquisition.header import make_header
from daq_app.acquisition.tare import take_tare
from daq_app.config import Rig, plan_tasks
from daq_app.runfile import JournalWriter, RunFileError, finalise, read_journal
from drivers import Opened
from sim_hardware.direct import SynthesisedTest, synthesise_test

_BLOCK_S: Final = 0.1
_TARE_S: Final = 1.0
_NO_EFFECTS: Final[Mapping[str, Mapping[str, float]]] = {}


def simulate_run(
    rig: Rig,
    rig_text: str,
    out: Path,
    *,
    test: str,
    theta0_over_alpha: float,
    r: float | None = None,
    seed: int | None = None,
    effects: Mapping[str, Mapping[str, float]] = _NO_EFFECTS,
    impacts_before: int = 0,
    keep_truth: bool = True,
) -> Path:
    """Write the run of one simulated test to `out`; None means what the rig file says.

    The wall is zeroed over the first second while it stands upright, as an operator would. Without
    `keep_truth` the run does not know what it was made from. Raises `ValueError` in words for a level,
    r or effect that makes no sense, `RunFileError` if `out` exists.
    """
    if out.exists():
        raise RunFileError(f"{out} exists", advice="Choose another name, or delete it first.")
    plan = plan_tasks(rig)
    made = synthesise_test(
        rig, plan, theta0_over_alpha, seed, restitution=r, effects=effects, impacts_before=impacts_before
    )
    opened = Opened(
        rate_hz=made.rate_hz, ranges={}, buffer_samples=0, devices=(), driver="simulated without real time"
    )
    still = min(made.upright_samples, round(_TARE_S * made.rate_hz))
    tare = take_tare(rig, made.readings[:, :still], 0)
    truth = made.truth if keep_truth else None
    header = make_header(rig, rig_text, plan, opened, tare, test=test, truth=truth)
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out.parent, prefix=".simulate-") as folder:
        journal = Path(folder) / "run.journal"
        writer = JournalWriter(journal, header)
        _write(writer, made, test)
        with read_journal(journal) as contents:
            derived, _ = derive(contents)
        return finalise(journal, out, derived, keep_journal=False)


def _write(writer: JournalWriter, made: SynthesisedTest, test: str) -> None:
    """The samples and the states of a test that went as planned."""
    rate = made.rate_hz
    block = max(1, math.ceil(_BLOCK_S * rate))
    n = made.readings.shape[1]
    writer.append_event("armed", 0, f"Simulated test {test}")
    for start in range(0, n, block):
        writer.append_block(start, np.ascontiguousarray(made.readings[:, start : start + block]))
    writer.append_event("released", made.release_sample, "released")
    rest = made.truth.get("rest_s")
    if isinstance(rest, float):
        writer.append_event("at_rest", round(rest * rate), "at rest")
    writer.append_event("end", n - 1, "complete", {"outcome": "complete"})
    writer.close()

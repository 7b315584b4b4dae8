"""Runs of the shipped rig from the simulated hardware, in memory and without real time."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

from daq_app.config import load_rig
from daq_app.config.rig import Rig
from daq_app.gap.rocking_model.records import GapRun
from tests.support.gap.simulated_campaign import LEVELS, campaign

RIG = Path(__file__).parents[2] / "configs" / "fr1.toml"


@cache
def short_rig() -> Rig:
    """The shipped rig with a short wait before the release and with scatter of r."""
    rig = load_rig(RIG)
    quick = {"upright_s": 0.5, "pull_s": 0.5, "hold_s": 1.2, "restitution_scatter": 0.004, "restitution": 0.9}
    return rig.model_copy(update={"simulation": rig.simulation.model_copy(update=quick)})


def simulate(
    effects: dict[str, dict[str, float]], levels: tuple[float, ...] = LEVELS, seed: int = 1
) -> list[GapRun]:
    """One run per level with calibration errors of 0.2 % besides `effects`."""
    return campaign(short_rig(), short_rig(), effects, seed, levels, post_rest_s=1.0)


def declared_slow(runs: list[GapRun], time_constant_s: float) -> list[GapRun]:
    """The same recordings, whose tiltmeters the rig file gives another time constant."""
    made = []
    for run in runs:
        sensors = (
            replace(s, time_constant_s=time_constant_s) if s.family == "tiltmeter" else s for s in run.sensors
        )
        made.append(replace(run, sensors=tuple(sensors)))
    return made

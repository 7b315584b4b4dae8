"""r and θ0 of simulated tests with real sensors' noise: both estimators, offline and online."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from daq_app.acquisition.course.tare import take_tare
from daq_app.config import Rig, Scaling, load_rig, plan_tasks
from daq_app.rocking import LiveAnalyser
from daq_app.rocking.analysis.analyse import analyse_record
from daq_app.rocking.analysis.options import AnalysisOptions
from daq_app.rocking.record import TestRecord
from sim_hardware.direct import synthesise_test

LEVELS = {"L1": 0.15, "L2": 0.25, "L3": 0.35, "L4": 0.40}
BLOCK = 400


@dataclasses.dataclass(frozen=True)
class Outcome:
    true_r: float
    true_phi0: float
    phi0: float
    offline: dict[str, float | None]
    online: dict[str, float | None]


def outcome(rig: Rig, level: str, r: float, seed: int) -> Outcome:
    """Simulate a test through the modules, zero it, and analyse it offline and block by block."""
    plan = plan_tasks(rig)
    made = synthesise_test(rig, plan, LEVELS[level], seed, restitution=r)
    tare = take_tare(rig, made.readings[:, :4000], 0)
    si = Scaling.of(rig.channels, tare.readings).to_si(made.readings)
    offsets = {p.channel.id: p.time_offset_s for task in plan.tasks for p in task.channels}
    record = TestRecord.from_array(rig, made.rate_hz, si, time_offsets_s=offsets)
    analysis = analyse_record(record, AnalysisOptions(fit=False, bias_runs=0, keep_series=False))
    live, estimate = LiveAnalyser(rig, made.rate_hz, tare.readings), None
    for start in range(0, made.readings.shape[1], BLOCK):
        estimate = live.process(start, made.readings[:, start : start + BLOCK]).estimate or estimate
    assert estimate is not None
    return Outcome(
        true_r=r,
        true_phi0=abs(float(made.truth["theta0_over_alpha"])),  # type: ignore[arg-type]
        phi0=analysis.theta0_over_alpha,
        offline={name: analysis.estimates[name].r for name in ("eav", "crt")},
        online={"eav": estimate.eav.r, "crt": estimate.crt.r},
    )


@pytest.fixture(scope="module")
def rig(configs: Path) -> Rig:
    return load_rig(configs / "fr1.toml")


@pytest.mark.heavy
@pytest.mark.parametrize("r", [0.82, 0.89, 0.95])
@pytest.mark.parametrize("level", LEVELS)
def test_r_and_theta0_are_recovered(rig: Rig, level: str, r: float) -> None:
    seen = outcome(rig, level, r, seed=round(1000 * r))
    allowed = 0.01 if level == "L1" else 0.003
    for estimates in (seen.offline, seen.online):
        assert estimates["eav"] == pytest.approx(seen.true_r, abs=allowed)
        assert estimates["crt"] == pytest.approx(seen.true_r, abs=allowed)
    assert seen.phi0 == pytest.approx(seen.true_phi0, abs=0.005)

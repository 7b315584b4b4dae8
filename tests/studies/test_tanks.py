"""The core on tanks that another integrator has filled: is the overflow found that was put in?"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from daq_app.gap.core import fit
from studies.real_gap.tanks_model import STEP_S, TanksModel, library, load_runs

LIMIT_V, SHARE, DEPTH_V = 8.0, 0.6, 0.05
"""The true tank spills like a weir: over a height of `DEPTH_V`, not at once."""


def record(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    time_s = np.arange(500) * STEP_S
    periods_s = (1900.0, 900.0, 560.0, 310.0)
    pump = 2.4 + sum(0.8 * np.sin(2 * np.pi * (time_s / p + rng.uniform())) for p in periods_s)
    pump = np.maximum(pump, 0.3)

    def flow(t: float, x: np.ndarray) -> list[float]:
        upper, lower = np.maximum(x, 0.0)
        spilled = 0.4 * max(upper - LIMIT_V, 0.0) / DEPTH_V
        out = 0.05 * np.sqrt(upper)
        into = 0.045 * float(np.interp(t, time_s, pump))
        return [into - out - spilled, out + SHARE * spilled - 0.055 * np.sqrt(lower)]

    found = solve_ivp(flow, (0.0, time_s[-1]), [4.0, 3.0], "LSODA", time_s, rtol=1e-6, max_step=STEP_S)
    return pump, np.minimum(found.y[1] + 0.02 * rng.standard_normal(time_s.size), 10.0)


def test_overflow_is_found_among_the_other_causes(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    columns = [record(rng), record(rng)]
    rows = zip(columns[0][0], columns[1][0], columns[0][1], columns[1][1], strict=True)
    text = "".join(f"{a:.5g},{b:.5g},{c:.5g},{d:.5g},,\n" for a, b, c, d in rows)
    path = tmp_path / "dataBenchmark.csv"
    path.write_text('"uEst","uVal","yEst","yVal","Ts",\n' + text, encoding="utf-8")
    runs, effects = load_runs(path), library()
    fits = {effect.name: fit(TanksModel(), runs, (effect,)) for effect in effects.named}
    ranking = sorted(fits, key=lambda name: -fits[name].log_evidence)
    assert ranking[0] == "overflow"
    assert fits["overflow"].log_evidence > fits[ranking[1]].log_evidence + 20
    level, _, _ = fits["overflow"].values["overflow.level"]
    _, low, high = fits["overflow"].values["overflow.share"]
    assert level == pytest.approx(LIMIT_V, abs=2 * DEPTH_V)
    assert low < SHARE < high

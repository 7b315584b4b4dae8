"""Closing the loop: diagnose → apply → simulate → compare, for effects of every kind.

    python -m studies.gap.loops [EFFECT …] [--seed S] [--again] [--page PAGE.md] [--cores N]

The first six runs are diagnosed and the result is applied to the rig file. Six further runs of the same
wall, which nothing was fitted to, are then predicted by the rig file as it was and as it is now: α, p,
r and the effects are the file's, only releases and sensor calibrations are free.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from daq_app.gap.apply import apply_result
from daq_app.gap.core import CannotDiagnose, Parameter, Prediction, Run, fit
from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.fitting.held_out import strain_of
from daq_app.gap.core.fitting.likelihood import Covariance
from daq_app.gap.core.fitting.problem import Problem
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.prediction.model import RockingModel
from daq_app.gap.rocking_model.study import model_and_library, prepare
from studies.gap.effects import CASES, diagnosed
from studies.gap.rows import Found, mark_of, run_study, states_in_words
from tests.support.gap.simulated_campaign import RIG, quick_rig, simulate

LOOPS = (
    "pivot_shift",
    "winkler",
    "restitution_slope",
    "restitution_asymmetry",
    "viscous",
    "coulomb",
    "base_tilt",
    "sliding",
    "flexible_wall",
    "compliance",
    "residual_cable",
    "gain@lvdt",
    "lag@lvdt",
    "wire_cosine@wire",
    "hum@LV-A03",
    "initial_velocity",
)
NEW_SEED = 77
WITHIN = 1.2


class FileModel(RockingModel):
    """The wall as a rig file has it: what the file says is fixed, calibrations and releases are free."""

    def __init__(self, rig: Path, believed: RockingModel) -> None:
        super().__init__(believed.survey, believed.channels, on_shaking_floor=believed.on_shaking_floor)
        loaded = quick_rig(rig)
        body, simulation = loaded.specimen, loaded.simulation
        p = float(np.sqrt(body.weight_n * body.r0_m / body.rotational_inertia_kg_m2))
        self._fixed = {
            "alpha": body.alpha0_rad,
            "p": p,
            "r": simulation.restitution,
            "half_base": body.r0_m * float(np.sin(body.alpha0_rad)),
        }
        self._effects = {
            f"{name}.{parameter}": value
            for name, given in simulation.effects.items()
            for parameter, value in given.items()
        }

    @property
    def nuisance(self) -> tuple[Parameter, ...]:
        return tuple(p for p in super().nuisance if p.name not in self._fixed)

    def predict(self, run: Run, values: Mapping[str, float]) -> Prediction:
        return super().predict(run, {**self._fixed, **self._effects, **values})


def gap_of(
    rig: Path, runs: list[RockingRun], yardstick: Mapping[str, float] | None = None
) -> tuple[float, dict[str, float]]:
    """(gap, scatters): rms over noise and scatter that a rig file leaves in runs; 1 is the floor.

    `yardstick` are the scatters to measure with; the file's own, as fitted, if left out.
    """
    model = FileModel(rig, model_and_library(runs)[0])
    found = fit(model, runs)
    problem = Problem(Experiment.of(model, runs), ())
    # A calibration that must be far off is a gap too, though the prediction follows it.
    square, count = strain_of(model, found), 0
    for i, (run, left) in enumerate(zip(runs, found.residuals, strict=True)):
        c = Covariance(run.features.sd, problem.predict(i, found.u), yardstick or found.sigmas)
        white = c.whiten(left)
        square += float(white @ white)
        count += left.size
    return float(np.sqrt(square / count)), found.sigmas


def loop(name: str, seed: int, cores: int) -> Found:
    """One effect through the loop."""
    effects = CASES[name]
    result = diagnosed(name, seed, cores)
    said: Found = {"effect": name, "decision": result["decision"], "named": result["which"][0]["effects"]}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "applied.toml"
        applied = apply_result(result, RIG, out)
        fresh, _ = prepare(simulate(effects, NEW_SEED))
        after, scatters = gap_of(out, fresh)
        before, scatters_before = gap_of(RIG, fresh, scatters)
        # The file must also run: its own simulated tests, seen by a diagnosis that believes the file.
        again, _ = prepare(simulate({}, NEW_SEED + 1, out, (0.25, -0.35), survey=RIG))
        resimulated, _ = gap_of(out, again)
    said |= {"applied": applied, "before": before, "after": after, "resimulated": resimulated}
    of_r = "scatter of r"
    return said | {"scatter_before": scatters_before[of_r], "scatter_after": scatters[of_r]}


def page(found: list[Found]) -> str:
    """The table as Markdown."""
    good = [f for f in found if "after" in f and f["after"] <= WITHIN]
    lines = [
        "# The loop closed: diagnose, apply, simulate, compare",
        "",
        "`python -m studies.gap.loops` (this page is written by it). Gap: rms over noise and scatter of "
        "six runs that nothing was fitted to, predicted from the rig file before and after `gap apply`; the "
        "floor is 1. Calibrations that the fit has to set far from what their certificates "
        "allow count as gap. Both are measured with the scatters found after. "
        f"{states_in_words(found)}",
        "",
        f"Within {WITHIN} of the floor: {len(good)} of {len(found)}.",
        "",
        "| effect | named | applied | gap before | after | scatter of r before → after | simulated again |",
        "|---|---|---|---|---|---|---|",
    ]
    for f in found:
        if "after" not in f:
            lines.append(f"| {f['effect']} | | {f['refusal']} | | | | |")
            continue
        on = "; ".join(
            f"{n}: " + ", ".join(f"{p} {v:.4g}" for p, v in given.items())
            for n, given in f["applied"].items()
        )
        lines.append(
            f"| {f['effect']}{mark_of(f)} | {' + '.join(f['named']) or 'nothing missing'} "
            f"({f['decision']}) | {on} | "
            f"{f['before']:.2f} | {f['after']:.2f} | {f['scatter_before']:.4f} → {f['scatter_after']:.4f} | "
            f"{f['resimulated']:.2f} |"
        )
    return "\n".join(lines) + "\n"


def _loop_or_refusal(name: str, seed: int, cores: int) -> Found:
    try:
        return loop(name, seed, cores)
    except CannotDiagnose as refusal:
        return {"effect": name, "refusal": str(refusal)}


def main(arguments: list[str] | None = None) -> int:
    """Run what is missing, then write the page."""
    return run_study(
        __doc__ or "",
        LOOPS,
        _loop_or_refusal,
        lambda found: f"{found.get('before')} → {found.get('after')} {found.get('refusal', '')}",
        page,
        Path("build/gap_loops"),
        arguments,
    )


if __name__ == "__main__":
    sys.exit(main())

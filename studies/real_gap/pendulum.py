"""``python -m studies.real_gap.pendulum``: which loss has a swinging rod, and what happens at its start?

Three records; each is held out whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console

from daq_app.gap.core import Diagnosis, Fit, Options, diagnose, fit
from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.fitting.held_out import score
from daq_app.gap.own_model import Measured
from studies.real_gap import pendulum_model as pm
from studies.real_gap.independence import with_independence
from studies.real_gap.report import arguments, print_rows, show

STAGES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("undamped", ()),
    ("viscous", ("viscous",)),
    ("quadratic", ("quadratic",)),
    ("viscous + quadratic", ("viscous", "quadratic")),
    ("viscous + Coulomb", ("viscous", "coulomb")),
    ("quadratic + Coulomb", ("quadratic", "coulomb")),
)


@dataclass(frozen=True)
class PendulumResult:
    """`degrees`: stage → rms over all held-out records, in degrees; `scores`: held-out log scores."""

    degrees: dict[str, float]
    fitted_degrees: dict[str, float]
    scores: dict[str, float]
    release: Diagnosis
    """From the angular acceleration of the whole records: what happens at the start."""
    loss: Diagnosis
    """From the angle after the release, with viscous damping in the baseline: which loss beyond it."""
    hand_end_s: dict[str, float]
    """Record → time at which the hand's torque is last significant."""
    traces: list[Measured]
    residuals: dict[str, list[FloatArray]]


def run(folder: Path) -> PendulumResult:
    """Everything that the command prints."""
    paths = sorted(folder.glob("free_swing_*.txt"))
    library = pm.library()
    records = with_independence(
        pm.PendulumModel(), pm.load_runs(paths), (library["hand"], library["quadratic"], library["coulomb"])
    )
    release = diagnose(pm.PendulumModel(), records, library, Options(causes=1, hold_out="repetition"))
    best = fit(pm.PendulumModel(), records, tuple(library[e] for e in release.which[0].effects))
    traces = pm.load_traces(paths)
    beyond_viscous = pm.TRACE_EFFECTS.without("viscous")
    options = Options(causes=1, hold_out="repetition")
    loss = diagnose(pm.TraceModel(viscous_in_baseline=True), traces, beyond_viscous, options)
    degrees, fitted_degrees, scores, residuals = {}, {}, {}, {}
    for name, effects in STAGES:
        chosen = tuple(pm.TRACE_EFFECTS[e] for e in effects)
        whole = fit(pm.TraceModel(), traces, chosen)
        held_out = score(Experiment.of(pm.TraceModel(), traces), chosen, whole, "repetition", whole.columns)
        residuals[name] = [r.residual for r in held_out]
        degrees[name] = _rms_degrees(residuals[name])
        fitted_degrees[name] = _rms_degrees(list(whole.residuals))
        scores[name] = sum(r.log_score for r in held_out)
    return PendulumResult(
        degrees, fitted_degrees, scores, release, loss, _hand_ends(best, paths), traces, residuals
    )


def _rms_degrees(residuals: list[FloatArray]) -> float:
    return float(np.rad2deg(np.sqrt(np.mean(np.concatenate(residuals) ** 2))))


def _hand_ends(best: Fit, paths: list[Path]) -> dict[str, float]:
    ends = {}
    for path, values in zip(paths, best.local_values, strict=True):
        significant = [
            t
            for i, t in enumerate(pm.HAND_KNOTS_S)
            if f"hand.h{i}" in values and not values[f"hand.h{i}"][1] < 0.0 < values[f"hand.h{i}"][2]
        ]
        ends[path.stem] = max(significant, default=0.0)
    return ends


def picture(result: PendulumResult, path: Path) -> None:
    """Held-out residual of each record under three losses."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(
        1, len(result.traces), figsize=(13, 3.4), sharey=True, constrained_layout=True
    )
    for k, (axis, record) in enumerate(zip(axes, result.traces, strict=True)):
        time = np.arange(len(record.features)) * pm.TRACE_STEP / pm.RATE_HZ
        for name in ("undamped", "viscous", "viscous + Coulomb"):
            axis.plot(
                time,
                np.rad2deg(result.residuals[name][k]),
                lw=1,
                label=f"{name}: {result.degrees[name]:.2f}°",
            )
        axis.set(title=f"{record.name}, held out", xlabel="s after the second turning point", ylim=(-20, 20))
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("angle residual (°)")
    axes[-1].legend(fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    options = arguments("Diagnose the free-swinging pendulum.")
    console = Console()
    result = run(options.data / "free_swing_pendulum")
    rows = [
        (
            name,
            f"{result.fitted_degrees[name]:.2f}°",
            f"{result.degrees[name]:.2f}°",
            f"{result.scores[name]:.0f}",
        )
        for name, _ in STAGES
    ]
    print_rows(
        console,
        ("loss", "rms, fitted", "rms, held out", "held-out log score"),
        rows,
        "Angle after the release",
    )
    show(console, "After the release; baseline: gravity and viscous damping", result.loss)
    show(
        console, "Whole records, angular acceleration; baseline: gravity and viscous damping", result.release
    )
    for record, end in result.hand_end_s.items():
        console.print(f"{record}: the hand acts until about {end:.2f} s")
    if options.pictures:
        picture(result, options.pictures / "gap-pendulum.png")
        console.print(f"written to {options.pictures / 'gap-pendulum.png'}")


if __name__ == "__main__":
    main()

"""``python -m studies.real_gap.tanks --data FOLDER``: what do two tanks lack that obey Torricelli's law?

FOLDER holds ``tanks/dataBenchmark.csv`` of the cascaded tanks benchmark (nonlinearbenchmark.org). The records
of estimation and validation are held out in turn.
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
from studies.real_gap.independence import with_independence
from studies.real_gap.report import arguments, print_rows, show
from studies.real_gap.tanks_model import TanksModel, library, load_runs

STAGES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("outlets and pump", ()),
    ("+ curve of the pump", ("pump_curve",)),
    ("+ outlet's exponent", ("outlet_exponent",)),
    ("+ overflow", ("overflow",)),
    ("+ overflow + dead band", ("overflow", "pump_dead_band")),
)


@dataclass(frozen=True)
class TanksResult:
    """`rises_v`: stage → rms of what is left of a rise of 20 s (fitted, held out), V."""

    rises_v: dict[str, tuple[float, float]]
    diagnosis: Diagnosis
    runs: list[Measured]
    fits: dict[str, Fit]


def run(folder: Path) -> TanksResult:
    """Everything that the command prints."""
    model, effects = TanksModel(), library()
    runs = load_runs(folder / "dataBenchmark.csv")
    runs = with_independence(model, runs, (effects["overflow"], effects["pump_dead_band"]))
    rises, fits = {}, {}
    for name, names in STAGES:
        chosen = tuple(effects[e] for e in names)
        fits[name] = fit(model, runs, chosen)
        held_out = score(Experiment.of(model, runs), chosen, fits[name], "level", fits[name].columns)
        rises[name] = (_rms(fits[name].residuals), _rms([r.residual for r in held_out]))
    return TanksResult(rises, diagnose(model, runs, effects, Options(hold_out="level")), runs, fits)


def _rms(residuals: list[FloatArray] | tuple[FloatArray, ...]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(list(residuals)) ** 2)))


def picture(result: TanksResult, path: Path) -> None:
    """What is left of each rise along the records, without and with the overflow."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    names = ("outlets and pump", "+ overflow", "+ overflow + dead band")
    figure, axes = plt.subplots(2, 2, figsize=(13, 5.2), sharex=True, sharey="row", constrained_layout=True)
    for column, record in enumerate(result.runs):
        hours = np.arange(record.inputs["level"].size) * 4.0 / 60.0
        starts = hours[record.inputs["starts"]]
        axes[0, column].plot(hours, record.inputs["level"], lw=1, color="k")
        axes[0, column].set_title(f"record of {record.name}")
        for name in names:
            axes[1, column].plot(
                starts,
                result.fits[name].residuals[column],
                ".-",
                ms=3,
                lw=0.7,
                label=f"{name}: {result.rises_v[name][1]:.3f} V held out",
            )
        axes[1, column].set_xlabel("time (min)")
        for axis in axes[:, column]:
            axis.grid(alpha=0.3)
    axes[0, 0].set_ylabel("level of the lower tank (V)")
    axes[1, 0].set_ylabel("left of a rise in 20 s (V)")
    axes[1, 0].legend(fontsize=8, loc="upper center")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    options = arguments("Diagnose the cascaded tanks.", "tanks/dataBenchmark.csv")
    console = Console()
    result = run(options.data / "tanks")
    rows = [(name, f"{a:.3f} V", f"{b:.3f} V") for name, (a, b) in result.rises_v.items()]
    print_rows(console, ("model", "rms, fitted", "rms, held out"), rows, "Left of a rise in 20 s")
    show(console, "Baseline: outlets and pump; pairs allowed", result.diagnosis, rows=8)
    if options.pictures:
        picture(result, options.pictures / "gap-tanks.png")
        console.print(f"written to {options.pictures / 'gap-tanks.png'}")


if __name__ == "__main__":
    main()

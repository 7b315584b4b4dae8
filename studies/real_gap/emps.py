"""``python -m studies.real_gap.emps``: what does a drive lack that has mass, or mass and viscous friction?

The first record is diagnosed; the second (with force pulses) is held out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console

from daq_app.gap.core import Diagnosis, Fit, Options, diagnose, fit
from daq_app.gap.own_model import Measured
from studies.real_gap.emps_model import EmpsModel, library, load_runs
from studies.real_gap.independence import with_independence
from studies.real_gap.report import arguments, print_rows, show

PUBLISHED = {"M": 95.109, "viscous.Fv": 203.503, "coulomb.Fc": 20.394, "offset": -3.165}
STAGES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("mass only", ()),
    ("+ viscous", ("viscous",)),
    ("+ viscous + Coulomb", ("coulomb", "viscous")),
    ("+ viscous + Coulomb + asymmetry", ("asymmetry", "coulomb", "viscous")),
)


@dataclass(frozen=True)
class EmpsResult:
    """`residuals`: stage → (training record, held-out record), rms residual over rms force.

    `published`: parameter → (found on the training record, published).
    """

    residuals: dict[str, tuple[float, float]]
    published: dict[str, tuple[float, float]]
    from_mass: Diagnosis
    from_viscous: Diagnosis
    runs: list[Measured]
    fits: dict[str, Fit]


def run(folder: Path) -> EmpsResult:
    """Everything that the command prints."""
    model, effects = EmpsModel(), library()
    training = load_runs(folder / "DATA_EMPS.mat")
    training = with_independence(model, training, effects.named)
    held_out = load_runs(folder / "DATA_EMPS_PULSES.mat")
    fits = {name: fit(model, training, tuple(effects[e] for e in names)) for name, names in STAGES}
    residuals = {
        name: (_relative(model, training, found), _relative(model, held_out, found))
        for name, found in fits.items()
    }
    reference = fits["+ viscous + Coulomb"].values
    published = {key: (reference[key][0], value) for key, value in PUBLISHED.items()}
    fraction = training[0].features.independent_fraction
    both = training + [
        replace(r, features=replace(r.features, independent_fraction=fraction)) for r in held_out
    ]
    from_mass = diagnose(model, both, effects, Options(hold_out="level"))
    with_viscous = EmpsModel(viscous_in_baseline=True)
    singles = Options(hold_out="level", causes=1)
    from_viscous = diagnose(
        with_viscous, both, library(with_viscous=False).without("friction_probe"), singles
    )
    return EmpsResult(residuals, published, from_mass, from_viscous, both, fits)


def _relative(model: EmpsModel, runs: list[Measured], found: Fit) -> float:
    """‖force − prediction‖ / ‖force‖ over all samples of the runs."""
    values = {key: value for key, (value, _, _) in found.values.items()}
    misses = np.concatenate([r.features.values - model.predict(r, values).features for r in runs])
    force = np.concatenate([r.features.values for r in runs])
    return float(np.linalg.norm(misses) / np.linalg.norm(force))


def picture(result: EmpsResult, path: Path) -> None:
    """Force residual over speed under each stage."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(STAGES), figsize=(13, 3.4), sharey=True, constrained_layout=True)
    training = [r for r in result.runs if r.level == "DATA_EMPS"]
    speed = np.array([label.amplitude for r in training for label in r.features.labels])
    for axis, (name, _) in zip(axes, STAGES, strict=True):
        axis.plot(speed, np.concatenate(result.fits[name].residuals), ".", ms=1.5)
        axis.set(title=f"{name}\n{100 * result.residuals[name][0]:.1f} % of the force", xlabel="speed (m/s)")
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("force residual (N)")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    options = arguments("Diagnose the EMPS drive.")
    console = Console()
    result = run(options.data / "emps")
    rows = [(k, f"{100 * a:.1f} %", f"{100 * b:.1f} %") for k, (a, b) in result.residuals.items()]
    print_rows(
        console, ("model", "DATA_EMPS (fitted)", "DATA_EMPS_PULSES (held out)"), rows, "Force residual"
    )
    against = [
        (k, f"{a:.3f}", f"{b:.3f}", f"{100 * (a / b - 1):+.2f} %") for k, (a, b) in result.published.items()
    ]
    print_rows(
        console, ("parameter", "found", "published", "difference"), against, "Against the published values"
    )
    show(console, "Baseline: mass only; pairs allowed", result.from_mass)
    show(console, "Baseline: mass and viscous friction; pairs allowed", result.from_viscous)
    if options.pictures:
        picture(result, options.pictures / "gap-emps.png")
        console.print(f"written to {options.pictures / 'gap-emps.png'}")


if __name__ == "__main__":
    main()

"""The results of a run as a table for people and as a document for machines."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from rich.table import Table

from daq_app.runfile import Run, open_run


def as_document(path: Path, outcome: str) -> dict[str, Any]:
    """Plain values of a run: what was recorded, θ0, r by each estimator. Raises `RunFileError`."""
    with open_run(path) as run:
        return _document(run, outcome)


def _document(run: Run, outcome: str) -> dict[str, Any]:
    lost = sum(gap.n_samples for gap in run.gaps)
    results = run.derived.results if run.derived is not None else {}
    estimate = _plain(results.get("estimate"))
    document: dict[str, Any] = {
        "run": str(run.path),
        "run_id": run.header.run_id,
        "test": run.header.test,
        "outcome": outcome or _outcome(run),
        "channels": len(run.channel_ids),
        "rate_hz": run.rate_hz,
        "n_samples": run.n_samples,
        "duration_s": run.n_samples / run.rate_hz,
        "lost_samples": lost,
        "gaps": len(run.gaps),
        "truth": run.header.truth,
        "estimate": None,
    }
    if isinstance(estimate, dict):
        alpha = _plain(results.get("alpha_rad"))
        theta0 = estimate.get("theta0_rad")
        share = theta0 / alpha if isinstance(alpha, float) and isinstance(theta0, float) else None
        document["estimate"] = {**estimate, "alpha_rad": alpha, "theta0_over_alpha": share}
    return document


def _outcome(run: Run) -> str:
    ends = [event for event in run.events if event.kind == "end"]
    return str(ends[-1].data.get("outcome", "")) if ends else "cut off"


def _plain(value: Any) -> Any:
    """NaN (a half-cycle that could not be fitted) becomes None: JSON has no NaN."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value


def results_table(path: Path) -> Table:
    """The table that ends `daq-app run`. Raises `RunFileError`."""
    document = as_document(path, "")
    table = Table(title=f"{document['test'] or document['run_id']}", title_justify="left", show_header=False)
    table.add_column(style="bold")
    table.add_column()
    lost = document["lost_samples"]
    table.add_row("run file", document["run"])
    table.add_row("ended", document["outcome"])
    table.add_row(
        "recorded",
        f"{document['channels']} channels × {document['n_samples']} samples = {document['duration_s']:.3f} s "
        f"at {document['rate_hz']:g} Hz",
    )
    table.add_row("lost", "none" if not lost else f"[bold red]{lost} samples in {document['gaps']} gap(s)[/]")
    estimate = document["estimate"]
    if estimate is None:
        table.add_row("r", "no release was found in this run")
        return table
    share = estimate["theta0_over_alpha"]
    theta0 = estimate["theta0_rad"]
    if theta0 is not None and share is not None:
        table.add_row("θ0", f"{1e3 * theta0:.2f} mrad, θ0/α = {abs(share):.4f}")
    table.add_row("impacts", str(len(estimate["impact_samples"])))
    for method in ("eav", "crt"):
        table.add_row(f"r {method.upper()}", _r_text(estimate, method))
    table.add_row("r max", f"{estimate['r_max']:.4f}  (1.2)")
    return table


def _r_text(estimate: dict[str, Any], method: str) -> str:
    mean, error = estimate[f"{method}_mean"], estimate[f"{method}_standard_error"]
    points = len(estimate[method])
    if mean is None:
        return f"–  ({points} values: too few)"
    spread = f" ± {error:.4f}" if error is not None else ""
    formula = {"eav": "4.4", "crt": "4.5"}[method]
    return f"{mean:.4f}{spread}  ({points} values, r/r_max {mean / estimate['r_max']:.3f})  ({formula})"

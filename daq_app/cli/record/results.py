"""The results of a run as a table for people and as a document for machines."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from daq_app.campaign.recorded import facts_of
from daq_app.config.wording import plus_minus
from daq_app.runfile import Run, open_run


def as_document(path: Path, outcome: str) -> dict[str, Any]:
    """Plain values of a run: what was recorded, θ0, r by each estimator. Raises `RunFileError`."""
    with open_run(path) as run:
        return _document(run, outcome)


def _document(run: Run, outcome: str) -> dict[str, Any]:
    lost = sum(gap.n_samples for gap in run.gaps)
    results, facts = run.results, facts_of(run)
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
        "results": _results(results.get("analysis"), results.get("online")),
        "quality": results.get("quality"),
        "operator": facts.operator,
        "notes": "\n".join(facts.notes),
    }
    return document


def _results(analysis: Any, online: Any) -> dict[str, Any] | None:
    """The figures of a test in brief; `daq-app analyse` gives all. None where nothing was released."""
    if not isinstance(analysis, dict) or not analysis.get("found"):
        return None
    estimates = analysis["estimates"]
    return {
        "theta0_rad": analysis["theta0_rad"],
        "theta0_over_alpha": analysis["theta0_over_alpha"],
        "impacts": len(analysis["half_cycles"]) - 1,
        "r_max": analysis["theory"]["r_max"],
        "r": {
            method: {
                "r": estimates[method]["r"],
                "standard_error": estimates[method]["standard_error"],
                "values": len(estimates[method]["points"]),
                "online": (online or {}).get(f"{method}_mean"),
            }
            for method in ("eav", "crt")
        },
    }


def _outcome(run: Run) -> str:
    ends = [event for event in run.events if event.kind == "end"]
    return str(ends[-1].data.get("outcome", "")) if ends else "cut off"


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
    gaps = Text(f"{lost} samples in {document['gaps']} gap(s)", "bold red")
    table.add_row("lost", gaps if lost else "none")
    results = document["results"]
    if results is None:
        table.add_row("r", "no release with an impact was found in this run")
    else:
        theta0, share = results["theta0_rad"], results["theta0_over_alpha"]
        table.add_row("θ0", f"{1e3 * theta0:.2f} mrad, θ0/α = {share:.4f}")
        table.add_row("impacts", str(results["impacts"]))
        for method, formula in (("eav", "(4.4)"), ("crt", "(4.5)")):
            table.add_row(f"r {method.upper()}", _r_text(results["r"][method], results["r_max"], formula))
        table.add_row("r max", f"{results['r_max']:.4f}  (1.2)")
    for label in ("operator", "notes"):
        if document[label]:
            table.add_row(label, document[label])
    quality = document["quality"]
    if quality:
        style = "bold green" if quality["verdict"] == "good" else "bold red"
        reasons = f": {'; '.join(quality['reasons'])}" if quality["reasons"] else ""
        table.add_row("verdict", Text.assemble((quality["verdict"], style), reasons))
    return table


def _r_text(estimate: dict[str, Any], r_max: float, formula: str) -> str:
    mean, error, online = estimate["r"], estimate["standard_error"], estimate["online"]
    if mean is None:
        return f"–  ({estimate['values']} values: too few)"
    spread = f" {plus_minus(error)}" if error is not None else ""
    live = f", online {online:.4f}" if online is not None else ""
    return f"{mean:.4f}{spread}  ({estimate['values']} values, r/r_max {mean / r_max:.3f}{live})  {formula}"

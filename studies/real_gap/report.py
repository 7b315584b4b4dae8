"""Tables and pictures shared by the diagnoses of real recordings."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from daq_app.gap.core import Diagnosis

DATA = Path(__file__).parents[2].parent / "shared" / "data" / "real"
"""Where the public recordings lie: the folder ``shared`` beside the repository."""


def arguments(description: str, needed: str = "") -> argparse.Namespace:
    """The options that all commands take; `needed`: a file that must be in the data folder."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--data", type=Path, default=DATA, help="folder with the public recordings")
    parser.add_argument("--pictures", type=Path, help="write pictures into this folder")
    options = parser.parse_args()
    if not options.data.is_dir():
        parser.error(f"there is no folder {options.data}; give it with --data")
    if not (options.data / needed).exists():
        parser.error(f"there is no {needed} in {options.data}; give the folder that holds it with --data")
    return options


def show(console: Console, title: str, result: Diagnosis, rows: int = 6) -> None:
    """The verdict, the ranking, the parameters and the gap."""
    console.print(f"\n[bold]{title}[/bold]\n{result.decision.verdict}: {result.decision.sentence}")
    console.print(f"where: {result.where.sentence}")
    table = Table("hypothesis", "family", "probability", "log evidence")
    for entry in result.which[:rows]:
        table.add_row(
            " + ".join(entry.effects) or "nothing missing",
            entry.family,
            f"{entry.probability:.4f}",
            f"{entry.log_evidence:.1f}",
        )
    console.print(table)
    estimates = Table("parameter", "value", "95 % interval", "unit")
    for e in (*result.parameters, *result.effect_parameters):
        estimates.add_row(e.name, f"{e.value:.5g}", f"{e.low:.5g} … {e.high:.5g}", e.unit)
    console.print(estimates)
    if result.gap is not None:
        gap = result.gap
        console.print(
            f"held-out gap in noise units: {gap.before:.2f} → {gap.after:.2f} (floor {gap.floor:.0f}), "
            f"closure {gap.closure:.3f}"
        )
    for limit in result.limits:
        console.print(f"limit: {limit}")


def print_rows(console: Console, columns: Sequence[str], rows: Sequence[Sequence[str]], title: str) -> None:
    table = Table(*columns, title=title)
    for row in rows:
        table.add_row(*row)
    console.print(table)

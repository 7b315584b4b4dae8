"""Figures as a table for the terminal and as a page of the documentation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.table import Table

from benchmarks.support.figure import Figure

_COLUMNS = ("figure", "value", "aim", "met", "runs", "note")
_RIGHT = ("value", "aim", "runs")


def _row(figure: Figure) -> tuple[str, ...]:
    sign = "≤" if figure.better == "low" else "≥"
    met = {None: "", True: "yes", False: "NO"}[figure.meets_aim]
    aim = "" if figure.aim is None else f"{sign} {figure.aim:g}"
    return figure.name, f"{figure.value:.4g} {figure.unit}", aim, met, str(figure.runs), figure.note


def terminal_table(results: Mapping[str, Sequence[Figure]]) -> Table:
    """All figures in one table."""
    table = Table(title="Benchmarks")
    for column in ("benchmark", *_COLUMNS):
        table.add_column(column, justify="right" if column in _RIGHT else "left")
    for name, figures in results.items():
        for figure in figures:
            table.add_row(name, *_row(figure))
    return table


def page(document: Mapping[str, Any], earlier: str = "") -> str:
    """A JSON document of figures as a Markdown page, one table a benchmark.

    `earlier`: the page as it was; tables of benchmarks that the document does not have stay.
    """
    lines = [
        "# Benchmarks",
        "",
        "What was measured, on how many runs; nothing here is a test, and a missed aim says NO.",
        "Measure again with",
        "",
        "```",
        "python -m benchmarks [NAME…] --page docs/reference/benchmarks.md",
        "```",
        "",
        "which replaces the tables of the benchmarks that were run. "
        "`--quick --json FILE` measures as little as shows that each works.",
    ]
    kept = {part.split("\n", 1)[0]: f"## {part.rstrip()}" for part in earlier.split("\n## ")[1:]}
    made = {name: _section(name, entry) for name, entry in document["benchmarks"].items()}
    sections = [section for _, section in sorted((kept | made).items())]
    return "\n\n".join(["\n".join(lines), *sections]) + "\n"


def _section(name: str, entry: Mapping[str, Any]) -> str:
    """The table of one benchmark with the command that makes it."""
    when = f"`python -m benchmarks {name}`, {entry['measured']}, {entry['machine']}."
    lines = [f"## {name}", "", when, "", "| " + " | ".join(_COLUMNS) + " |"]
    lines += ["|" + "|".join("---:" if c in _RIGHT else "---" for c in _COLUMNS) + "|"]
    for figure in entry["figures"]:
        cells = (cell.replace("|", "\\|") for cell in _row(Figure(**figure)))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)

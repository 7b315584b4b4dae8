"""``python -m benchmarks [NAME…] [--json FILE]``: runs the benchmarks, prints a table, writes JSON.

Each module ``benchmarks/bench_NAME.py`` has ``figures() -> list[Figure]``. Nothing here is a test:
a missed aim is printed as missed.
"""

from __future__ import annotations

import argparse
import importlib
import json
import platform
import sys
import time
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.figure import Figure

_DEFAULT_JSON = Path("benchmarks.json")


def _available() -> list[str]:
    return sorted(path.stem.removeprefix("bench_") for path in Path(__file__).parent.glob("bench_*.py"))


def _run(name: str, console: Console) -> list[Figure]:
    console.print(f"[bold]{name}[/bold] …")
    figures: list[Figure] = importlib.import_module(f"benchmarks.bench_{name}").figures()
    return figures


def _table(results: dict[str, list[Figure]]) -> Table:
    table = Table(title="Benchmarks")
    for column in ("benchmark", "figure", "value", "aim", "met", "runs", "note"):
        table.add_column(column, justify="right" if column in ("value", "aim", "runs") else "left")
    for name, figures in results.items():
        for figure in figures:
            sign = "≤" if figure.better == "low" else "≥"
            met = {None: "", True: "yes", False: "NO"}[figure.meets_aim]
            aim = "" if figure.aim is None else f"{sign} {figure.aim:g}"
            value = f"{figure.value:.4g} {figure.unit}"
            table.add_row(name, figure.name, value, aim, met, str(figure.runs), figure.note)
    return table


def main() -> int:
    """Run what was asked for; 0 when every benchmark ran, whatever it measured."""
    names = _available()
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"any of {', '.join(names)}; all if none")
    parser.add_argument("--json", type=Path, default=_DEFAULT_JSON, help="where to write the figures")
    options = parser.parse_args()
    unknown = [name for name in options.names if name not in names]
    if unknown:
        parser.error(f"no such benchmark: {', '.join(unknown)}; there are {', '.join(names)}")
    console = Console(width=None if sys.stdout.isatty() else 140)
    results = {name: _run(name, console) for name in options.names or names}
    console.print(_table(results))
    document = {
        "machine": {"platform": platform.platform(), "python": platform.python_version()},
        "measured": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "figures": {name: [asdict(figure) for figure in figures] for name, figures in results.items()},
    }
    options.json.write_text(json.dumps(document, indent=1), encoding="utf-8")
    console.print(f"written to {options.json}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""``python -m benchmarks [NAME…] [--json FILE] [--page FILE]``: runs benchmarks, prints a table, writes JSON.

Each module ``benchmarks/bench_NAME.py`` has ``figures(effort: Effort) -> list[Figure]``. Nothing here is a
test: a missed aim is printed as missed. Figures of benchmarks that were not run stay as they are in the JSON.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import platform
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console

from benchmarks.support.effort import Effort
from benchmarks.support.figure import Figure
from benchmarks.support.tables import page, terminal_table

_DEFAULT_JSON = Path("benchmarks.json")
_FORMAT = 2


def _available() -> list[str]:
    return sorted(path.stem.removeprefix("bench_") for path in Path(__file__).parent.glob("bench_*.py"))


def _run(name: str, effort: Effort, console: Console) -> list[Figure]:
    console.print(f"[bold]{name}[/bold] …")
    figures: list[Figure] = importlib.import_module(f"benchmarks.bench_{name}").figures(effort)
    return figures


def _known(path: Path) -> dict[str, Any]:
    """What an earlier run wrote; empty where there is none that can be read."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    fits = isinstance(document, dict) and document.get("format") == _FORMAT
    return dict(document["benchmarks"]) if fits else {}


def main() -> int:
    """Run what was asked for; 0 when every benchmark ran, whatever it measured."""
    # As `daq-app` has it; NumPy is not loaded before a benchmark is.
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    names = _available()
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"any of {', '.join(names)}; all if none")
    parser.add_argument("--json", type=Path, default=_DEFAULT_JSON, help="where to write the figures")
    parser.add_argument("--page", type=Path, help="a Markdown page to write all known figures to")
    parser.add_argument(
        "--quick",
        action="store_true",
        help="the least that shows that a benchmark works; needs a --json of its own",
    )
    options = parser.parse_args()
    if options.quick and (options.page or options.json == _DEFAULT_JSON):
        parser.error("--quick takes a --json of its own and no --page: its figures say nothing about speed")
    unknown = [name for name in options.names if name not in names]
    if unknown:
        parser.error(f"no such benchmark: {', '.join(unknown)}; there are {', '.join(names)}")
    console = Console(width=None if sys.stdout.isatty() else 140)
    results = {name: _run(name, Effort(options.quick), console) for name in options.names or names}
    console.print(terminal_table(results))
    machine = f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores, "
    machine += f"Python {platform.python_version()}"
    measured = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())
    known = _known(options.json)
    for name, figures in results.items():
        entry = {"measured": measured, "machine": machine, "figures": [asdict(f) for f in figures]}
        known[name] = entry
    document = {"format": _FORMAT, "benchmarks": known}
    options.json.write_text(json.dumps(document, indent=1), encoding="utf-8")
    console.print(f"written to {options.json}")
    if options.page:
        earlier = options.page.read_text(encoding="utf-8") if options.page.exists() else ""
        options.page.write_text(page(document, earlier), encoding="utf-8")
        console.print(f"written to {options.page}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

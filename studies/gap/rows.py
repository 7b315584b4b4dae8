"""A study of many cases that can be interrupted: one JSON per case and seed, a page from all that there are.

Every row keeps the state of the code that it was measured with. Rows of another state are kept and shown
as such, or with ``--again`` measured anew.
"""

from __future__ import annotations

import argparse
import csv
import json
import time
from collections import Counter
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import psutil

from studies.gap.code_state import CodeState, code_state

Found = dict[str, Any]
MATTERS = (
    "daq_app/gap/apply.py",
    "daq_app/gap/core",
    "daq_app/gap/rocking_model",
    "daq_app/config",
    "sim_hardware",
    "configs/fr1.toml",
    "tests/support/gap/simulated_campaign.py",
)
"""What the figures of these studies depend on."""


@cache
def state_now() -> CodeState:
    """State of the code that this process runs."""
    return code_state(MATTERS)


def run_study(
    about: str,
    cases: Sequence[str],
    do: Callable[[str, int, int], Found],
    say: Callable[[Found], str],
    page: Callable[[list[Found]], str],
    folder: Path,
    arguments: Sequence[str] | None = None,
) -> int:
    """Do the cases whose JSON is not there yet, then write the page. Returns the exit code.

    `do(name, seed, cores)` does one case.
    """
    given = _arguments(about, cases, folder, arguments)
    state = state_now()
    given.out.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    for name in given.effects or cases:
        target = given.out / f"{name}-{given.seed}.json"
        if target.exists() and not (given.again and _read(target)["code"] != state.code):
            continue
        if time.monotonic() - began > given.for_s:
            break
        found = do(name, given.seed, given.cores) | {
            "seed": given.seed,
            "commit": state.commit,
            "code": state.code,
        }
        target.write_text(json.dumps(found, indent=1), encoding="utf-8")
        print(f"{name}, seed {given.seed}: {say(found)}", flush=True)
    if given.quiet:
        return 0
    done = [path for name in cases for path in sorted(given.out.glob(f"{name}-[0-9]*.json"))]
    text = page(_marked([_read(path) for path in done]))
    if given.page:
        write_page(text, given.page)
    else:
        print(text)
    return 0


def write_page(text: str, path: Path) -> None:
    """Write a page with one table: its text as Markdown, its rows as a CSV of the same name."""
    lines = text.splitlines()
    rows = [line for line in lines if line.startswith("|") and not line.startswith("|---")]
    table = path.with_suffix(".csv")
    first = lines.index(rows[0])
    words = [line for line in lines[:first] if not line.startswith("|")]
    words += [f"All {len(rows) - 1} rows: [{table.name}]({table.name})."]
    words += [line for line in lines[first:] if not line.startswith("|")]
    path.write_text("\n".join(words) + "\n", encoding="utf-8")
    with table.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerows(_cells(row) for row in rows)


def _cells(row: str) -> list[str]:
    return [cell.strip().replace("**", "") for cell in row.strip().strip("|").split(" | ")]


def cpu_s() -> float:
    """Processor time of this process and of those that it has waited for, s."""
    return float(sum(psutil.Process().cpu_times()[:4]))


def _arguments(
    about: str, cases: Sequence[str], folder: Path, arguments: Sequence[str] | None
) -> argparse.Namespace:
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=about, formatter_class=raw)
    parser.add_argument("effects", nargs="*", help="cases to do; all if none is named")
    parser.add_argument("--out", type=Path, default=folder)
    parser.add_argument("--page", type=Path, help="write the page there instead of printing it")
    parser.add_argument("--cores", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--for-s", type=float, default=float("inf"), help="begin no case after this long")
    parser.add_argument("--again", action="store_true", help="measure rows of another state of the code anew")
    parser.add_argument("--quiet", action="store_true", help="make no page")
    given = parser.parse_args(arguments)
    unknown = [name for name in given.effects if name not in cases]
    if unknown:
        parser.error(f"unknown cases {', '.join(unknown)}; there are {', '.join(cases)}")
    return given


def states_in_words(found: Sequence[Found]) -> str:
    """The state of the code of all rows, as a sentence; `mark_of` marks those of another than most."""
    if not found:
        return ""
    usual = next((f["commit"] for f in found if not mark_of(f)), "")
    if not any(mark_of(f) for f in found):
        return f"All rows were measured with the code of commit {usual}."
    return (
        f"Rows without a mark were measured with the code of commit {usual}, the others with that of the "
        "commit in their mark."
    )


def mark_of(found: Found) -> str:
    """A mark for a row of another state of the code than most."""
    return str(found.get("mark", ""))


def _marked(found: list[Found]) -> list[Found]:
    usual = Counter(f["code"] for f in found).most_common(1)
    return [f | {"mark": "" if f["code"] == usual[0][0] else f" [{f['commit']}]"} for f in found]


def _read(path: Path) -> Found:
    found: Found = json.loads(path.read_text(encoding="utf-8"))
    return found

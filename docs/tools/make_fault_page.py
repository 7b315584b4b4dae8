"""Runs the tests of the faults and writes their table into `docs/reference/faults.md`.

python -m uv run python docs/tools/make_fault_page.py
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[1]
BEGIN, END = "<!-- table: begin -->", "<!-- table: end -->"


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown of the rows that the tests have put down."""
    lines = [
        "| fault | detected after | lost | in the gap table | verdict | what the operator was told first |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        after = "–" if row["after_s"] is None else f"{row['after_s']:.2f} s"
        lost = "–" if row["lost"] is None else str(row["lost"])
        gaps = "–" if row["gap_table"] is None else str(row["gap_table"])
        lines.append(
            f"| {row['fault']} | {after} | {lost} | {gaps} | {row['verdict']} | {plain(row['told'])} |"
        )
    return "\n".join(lines)


def plain(text: str) -> str:
    """Without what differs from machine to machine, and safe in a table."""
    text = re.sub(r"\S*[/\\](?:[\w.-]+[/\\])+", "…/", text)
    text = re.sub(r"(\w+-)+\w+_\d{8}T\d{6}-\d+Z", "RUN", text)
    text = re.sub(r"\(process \d+ on [\w.-]+\)", "(process N on HOST)", text)
    text = re.sub(r"127\.0\.0\.1:\d+", "HOST:PORT", text)
    return text.replace("|", "/").replace("\n", " ")


def main() -> int:
    """The exit code of the tests."""
    with tempfile.TemporaryDirectory() as name:
        rows = Path(name) / "rows.json"
        folder = str(DOCS.parent / "tests" / "faults")
        command = [sys.executable, "-m", "pytest", folder, "-q"]
        code = subprocess.run(
            command, cwd=DOCS.parent, env={**os.environ, "FAULT_TABLE": str(rows)}, check=False
        ).returncode
        found = json.loads(rows.read_text(encoding="utf-8"))
    page = DOCS / "reference" / "faults.md"
    before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    page.write_text(f"{before}{BEGIN}\n\n{table(found)}\n\n{END}{after}", encoding="utf-8")
    print(f"{page}: {len(found)} faults")
    return code


if __name__ == "__main__":
    sys.exit(main())

"""Pins every dependency: ``python .ci/pin.py`` after a change of ``[project] dependencies``.

Resolves afresh, then writes the versions to `constraints.txt` (for pip: ``pip install -c``) and into
``[tool.uv] constraint-dependencies`` of `pyproject.toml` (for uv).  No lock file is kept because one
would hold the addresses of the package registry of the machine that made it.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BEGIN = "# pinned by .ci/pin.py: begin"
END = "# pinned by .ci/pin.py: end"
HEADER = "# Written by .ci/pin.py; the same versions stand in pyproject.toml.\n"


def resolve() -> list[str]:
    """Every package of every group and extra with its exact version and marker."""
    command = "export --quiet --upgrade --no-hashes --no-annotate --no-header --no-emit-project"
    answer = subprocess.run(
        [sys.executable, "-m", "uv", *command.split(), "--all-groups", "--all-extras"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    return answer.stdout.strip().splitlines()


def main() -> None:
    """Rewrite both places from one resolution."""
    project = ROOT / "pyproject.toml"
    pattern = re.compile(re.escape(BEGIN) + ".*?" + re.escape(END), re.DOTALL)
    text = project.read_text(encoding="utf-8")
    if not pattern.search(text):
        sys.exit(f"{project} has no block between '{BEGIN}' and '{END}'")
    # Old pins would hold the new resolution back: empty the block before resolving.
    project.write_text(pattern.sub(f"{BEGIN}\n{END}", text), encoding="utf-8")
    try:
        pins = resolve()
    except subprocess.CalledProcessError as error:
        project.write_text(text, encoding="utf-8")
        sys.exit(f"uv could not resolve the dependencies; pyproject.toml is as it was.\n{error.stderr}")
    block = "\n".join([BEGIN, *(f'  "{pin}",' for pin in pins), f"  {END}"])
    project.write_text(pattern.sub(block.replace("\\", "\\\\"), text), encoding="utf-8")
    (ROOT / "constraints.txt").write_text(HEADER + "\n".join(pins) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

"""``python -m studies.ni_suite FOLDER``: NI's suite against the simulated server, as a table by file.

FOLDER is a copy of NI's repository of the Python client (with ``tests/`` in it); nothing is fetched. The
suite needs pytest-mock and pykka beside what this repository installs.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from studies.ni_suite.plugin import PORT_VARIABLE, RESULTS_VARIABLE

_HOUSE = Path(__file__).resolve().parents[2]
_PARTS = ("tests/component", "tests/legacy", "tests/acceptance")
_ANALOG_INPUT = re.compile(
    r"(^|[/_.])ai(_|\b)|ai_|analog_(single|multi)_channel_(\w+_)?read|analog_(multi_channel|single_channel|"
    r"unscaled)_reader|power_reader|in_stream|teds|test_timing|test_triggers|test_export|pwr|power"
)


def start_server(folder: Path) -> tuple[subprocess.Popen[str], int]:
    """The simulated server with NI's exports as inventory, and one card whose outputs its inputs see."""
    exports = [
        option
        for name in ("nidaqmxMaxConfig.ini", "nidaqmxMaxConfig26Q1.ini")
        if (folder / "tests/max_config" / name).exists()
        for option in ("--max-export", str(folder / "tests/max_config" / name))
    ]
    command = [sys.executable, "-m", "sim_hardware.daqmx_server", *exports]
    command += ["--device", "loopback=PCIe-6363", "--real", "loopback"]
    server = subprocess.Popen(command, cwd=_HOUSE, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    for line in server.stdout:
        match = re.search(r"listening on port (\d+)", line)
        if match:
            return server, int(match[1])
    raise SystemExit("the simulated server did not start")


def run(folder: Path, parts: list[str]) -> list[dict[str, str]]:
    """Outcome and reason of every test that uses gRPC."""
    server, port = start_server(folder)
    try:
        with tempfile.TemporaryDirectory() as scratch:
            results = Path(scratch) / "results.jsonl"
            environment = os.environ | {
                PORT_VARIABLE: str(port),
                RESULTS_VARIABLE: str(results),
                "PYTHONPATH": str(_HOUSE),
            }
            command = [sys.executable, "-m", "pytest", "-q", "-p", "studies.ni_suite.plugin"]
            command += ["-p", "no:pytest-qt", "-p", "no:cacheprovider", "--timeout", "120", *parts]
            said = subprocess.run(
                command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True, check=False
            )
            lines = results.read_text(encoding="utf-8").splitlines() if results.exists() else []
            if not any(lines):
                raise SystemExit(f"NI's suite ran no test; pytest ended with:\n{said.stdout[-2000:]}")
            return [json.loads(line) for line in lines if line]
    finally:
        server.terminate()
        server.wait()


def is_analog_input(test: str) -> bool:
    """Whether a test is about analogue input, by its file and name."""
    name = test.partition("[")[0].lower()
    return _ANALOG_INPUT.search(name) is not None and "power_up" not in name  # power-up states are outputs'


def table(rows: list[dict[str, str]]) -> str:
    """Passed, failed and skipped by file, the scores, and each test that did not pass with its reason."""
    counts: dict[str, Counter[str]] = {}
    for row in rows:
        counts.setdefault(row["test"].partition("::")[0], Counter())[row["outcome"]] += 1
    lines = ["| file | passed | failed | skipped |", "|---|---|---|---|"]
    lines += [
        f"| {file} | {c['passed']} | {c['failed']} | {c['skipped']} |" for file, c in sorted(counts.items())
    ]
    for name, chosen in (
        ("all tests that use gRPC", rows),
        ("analogue input", [row for row in rows if is_analog_input(row["test"])]),
    ):
        passed = sum(row["outcome"] == "passed" for row in chosen)
        lines.append(
            f"\n{name}: {passed} of {len(chosen)} passed ({100 * passed / max(len(chosen), 1):.1f} %)"
        )
    for row in rows:
        if row["outcome"] != "passed":
            reason = " ".join(row["reason"].split())[:200]
            lines.append(f"- {row['outcome']}: {row['test']}: {reason}")
    return "\n".join(lines)


def main() -> None:
    options = argparse.ArgumentParser(prog="python -m studies.ni_suite", description=__doc__)
    options.add_argument("folder", type=Path, help="copy of NI's repository of the Python client")
    options.add_argument("parts", nargs="*", default=list(_PARTS), help="folders or files of its tests")
    arguments = options.parse_args()
    if not (arguments.folder / "tests/component").is_dir():
        raise SystemExit(f"{arguments.folder} holds no tests/component: give a copy of NI's repository")
    print(table(run(arguments.folder, arguments.parts)))


if __name__ == "__main__":
    main()

"""``python -m studies.ni_examples FOLDER``: NI's examples on the simulated server, as a table by folder.

FOLDER is a copy of NI's repository of the Python client (with ``examples/`` in it); nothing is fetched. Each
example runs unchanged in a process of its own on the devices that it names (`DEVICES`).
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

_HOUSE = Path(__file__).resolve().parents[2]
DEVICES = (
    "Dev1=PCIe-6363",
    "cDAQ1=cDAQ-9178",
    "cDAQ1Mod1=NI 9205",
    "PXI1Slot3=PXIe-4497",
    "PXI1Slot7=PXIe-4497",
    "TS1=TS-15000",
    "TS1Mod1=TS-15200",
    "cdaqTester=cDAQ-9189",
    "cdaqTesterMod4=NI 9401",
    "Dev2=USB-4431",
)
"""What the examples name; the other devices do not matter to them."""
_PRESS_S = 2.5
"""Seconds after which somebody presses Enter; Ctrl-C comes after four times that."""
_NEED_SIGNAL = {
    "counter_in/cnt_dig_event.py": "counts edges at PFI8",
    "counter_in/cont_cnt_buff_event_ext_clk.py": "is clocked by a signal at PFI9",
}
"""Examples that do nothing before something real is wired to the device."""
_NOTHING = re.compile(r"Acquired 0 total .*samples")
_LIMIT_S = 60.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """How one example ended."""

    example: str
    passed: bool
    said: str
    """Last line of its output, or of its error."""


def start_server() -> tuple[subprocess.Popen[str], str]:
    """A simulated server with the examples' devices."""
    command = [sys.executable, "-m", "sim_hardware.daqmx_server"]
    command += [part for device in DEVICES for part in ("--device", device)]
    server = subprocess.Popen(command, cwd=_HOUSE, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    for line in server.stdout:
        if match := re.search(r"listening on port (\d+)", line):
            return server, f"127.0.0.1:{match[1]}"
    raise SystemExit("the simulated server did not start")


def run_one(folder: Path, example: Path, address: str) -> Outcome:
    """One example, unchanged, in a process of its own."""
    name = example.relative_to(folder / "examples").as_posix()
    command = [sys.executable, "-m", "studies.ni_examples.stranger", address, str(_PRESS_S), str(example)]
    try:
        ended = subprocess.run(
            command, cwd=_HOUSE, capture_output=True, text=True, timeout=_LIMIT_S, check=False
        )
    except subprocess.TimeoutExpired:
        return Outcome(name, False, f"did not end within {_LIMIT_S:.0f} s")
    worked = ended.returncode == 0 and not _NOTHING.search(ended.stdout)
    text = ended.stdout if ended.returncode == 0 else ended.stderr
    lines = [line for line in text.splitlines() if line.strip()]
    return Outcome(name, worked, lines[-1] if lines else "")


def run(folder: Path, part: str) -> list[Outcome]:
    """Every example whose path holds `part`."""
    examples = sorted(
        path
        for path in (folder / "examples").rglob("*.py")
        if part in path.as_posix() and path.name[0] != "_"
    )
    server, address = start_server()
    try:
        return [run_one(folder, example, address) for example in examples]
    finally:
        server.terminate()
        server.wait()


def table(outcomes: list[Outcome]) -> str:
    """Passed and all by folder, then each that failed with its last words."""
    counts: dict[str, Counter[bool]] = {}
    for outcome in outcomes:
        if outcome.example in _NEED_SIGNAL:
            continue
        counts.setdefault(outcome.example.rpartition("/")[0] or "(top)", Counter())[outcome.passed] += 1
    lines = ["| examples | ran as they are | of |", "|---|---|---|"]
    lines += [f"| {name} | {count[True]} | {count.total()} |" for name, count in sorted(counts.items())]
    judged = [outcome for outcome in outcomes if outcome.example not in _NEED_SIGNAL]
    lines.append(f"\n{sum(o.passed for o in judged)} of {len(judged)} examples ran")
    lines += [f"- failed: {o.example}: {o.said[:200]}" for o in judged if not o.passed]
    lines += [f"- needs a real signal: {o} {_NEED_SIGNAL[o]}" for o in _NEED_SIGNAL]
    return "\n".join(lines)


def main() -> None:
    options = argparse.ArgumentParser(prog="python -m studies.ni_examples", description=__doc__)
    options.add_argument("folder", type=Path, help="copy of NI's repository of the Python client")
    options.add_argument("--all", action="store_true", help="the last words of every example")
    options.add_argument("--only", default="", help="part of the path of the examples to run")
    arguments = options.parse_args()
    if not (arguments.folder / "examples").is_dir():
        raise SystemExit(f"{arguments.folder} holds no examples: give a copy of NI's repository")
    outcomes = run(arguments.folder, arguments.only)
    print(table(outcomes))
    if arguments.all:
        print("\n".join(f"- {o.example}: {o.said[:160]}" for o in outcomes if o.passed))


if __name__ == "__main__":
    main()

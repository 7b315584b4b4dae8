"""What the long checks on a marked line share: rig, device server, command line, and the written report.

On a marked line (`sim_hardware.marked_line`) every sample proves its place; `marked_check` reads it.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from rich.console import Console

from daq_app.acquisition.process.simulated import SimulatedServer

RIG: Final = Path(__file__).parents[2] / "configs" / "fr1.toml"


def marked_server(speed: float) -> SimulatedServer:
    """A device server on a marked line, `speed` times faster than real time."""
    return SimulatedServer(RIG, ["--speed", str(speed), "--wall", "marked"])


def command_line(name: str, about: str | None, *, speed: float) -> argparse.ArgumentParser:
    """``python -m studies.recording.NAME`` with --seed, --speed and --json; more by the caller."""
    parser = argparse.ArgumentParser(prog=f"python -m studies.recording.{name}", description=about)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--speed", type=float, default=speed, help="of the simulated device")
    parser.add_argument("--json", type=Path, default=Path(f"{name}.json"))
    return parser


def console() -> Console:
    """Where results go; as wide as the terminal, 140 columns in a file."""
    return Console(width=None if sys.stdout.isatty() else 140)


def write_report(path: Path, report: Mapping[str, Any]) -> None:
    """The whole report as JSON."""
    path.write_text(json.dumps(report, indent=1), encoding="utf-8")

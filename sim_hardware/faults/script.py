"""Faults written down in a file: TOML ``[[fault]]`` tables, or a JSON list of objects."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

from daq_app.config.errors import ConfigError, Problem
from sim_hardware.faults.model import Fault, fault_from


def load_faults(path: Path) -> list[Fault]:
    """The faults of a script. Raises `ConfigError` with every problem of the file."""
    try:
        tables = _tables(path)
    except (OSError, ValueError) as error:
        raise ConfigError(
            [Problem(str(path), "", f"the fault script cannot be read ({error})", "Write [[fault]] tables")]
        ) from error
    faults, problems = [], []
    for index, table in enumerate(tables):
        try:
            faults.append(fault_from(table))
        except ValueError as error:
            problems.append(
                Problem(str(path), f"fault[{index}]", str(error), "See docs/how-to/simulated-hardware.md")
            )
    if problems:
        raise ConfigError(problems)
    return faults


def _tables(path: Path) -> list[dict[str, Any]]:
    text = path.read_text(encoding="utf-8")
    content: Any = json.loads(text) if path.suffix == ".json" else tomllib.loads(text).get("fault", [])
    if not isinstance(content, list) or not all(isinstance(item, dict) for item in content):
        raise ValueError("it holds no list of faults")
    return content

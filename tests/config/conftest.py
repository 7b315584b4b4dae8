"""Rig files to spoil: as tables, as text, and the complaints about them."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from daq_app.config import ConfigError, Problem, parse_rig, plan_tasks

Tables = dict[str, Any]


@pytest.fixture
def fr1(configs: Path) -> Tables:
    """Tables of the shipped FR1 rig, free to be changed."""
    return tomllib.loads((configs / "fr1.toml").read_text(encoding="utf-8"))


@pytest.fixture
def fr1_iepe(configs: Path) -> Tables:
    return tomllib.loads((configs / "fr1-iepe.toml").read_text(encoding="utf-8"))


@pytest.fixture
def fr1_pxie(configs: Path) -> Tables:
    return tomllib.loads((configs / "fr1-pxie.toml").read_text(encoding="utf-8"))


@pytest.fixture
def problems() -> Callable[[Tables], list[Problem]]:
    """Everything that loading and planning says is wrong with a rig's tables; empty if it is good."""

    def ask(tables: Tables) -> list[Problem]:
        try:
            plan_tasks(parse_rig(tomli_w.dumps(tables), "rig.toml"), "rig.toml")
        except ConfigError as error:
            return list(error.problems)
        return []

    return ask

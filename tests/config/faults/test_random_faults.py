"""Whatever is done to a rig file, it loads or it is refused in words; nothing else happens."""

from __future__ import annotations

import copy
import datetime as dt
import functools
import math
import tomllib
from pathlib import Path
from typing import Any

import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from daq_app.config import ConfigError, parse_rig, plan_tasks

_CONFIGS = Path(__file__).parents[3] / "configs"
_NAMES = ("fr1", "fr1-iepe", "fr1-pxie")
_VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**40), 2**40),
    st.floats(),
    st.text(st.characters(exclude_categories=["Cs", "Cc"]), max_size=12),
    st.dates(dt.date(1, 1, 1)),
    st.just([]),
    st.just({}),
    st.lists(st.floats(-10, 10), max_size=4),
    st.sampled_from(["NI 9205", "NI 9219", "NI 9234", "PXIe-4340", "cDAQ1Mod1/ai0", "DIFF", "RSE", "iepe"]),
)


@functools.cache
def _text(name: str) -> str:
    return (_CONFIGS / f"{name}.toml").read_text(encoding="utf-8")


@functools.cache
def _tables(name: str) -> dict[str, Any]:
    return tomllib.loads(_text(name))


def _holders(node: object) -> list[Any]:
    """Every table and list of the tree."""
    found: list[Any] = []
    if isinstance(node, dict):
        found.append(node)
        for value in node.values():
            found += _holders(value)
    elif isinstance(node, list):
        found.append(node)
        for value in node:
            found += _holders(value)
    return found


def _loads_or_is_refused(text: str) -> None:
    try:
        plan = plan_tasks(parse_rig(text, "rig.toml"), "rig.toml")
    except ConfigError as error:
        assert error.problems
        for problem in error.problems:
            assert problem.key and problem.wrong
            assert str(problem).startswith("rig.toml: ")
    else:
        assert math.isfinite(plan.rate_hz)
        assert sum(len(task.channels) for task in plan.tasks) == plan.n_channels


@settings(max_examples=150, suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
def test_changed_values(data: st.DataObject) -> None:
    tables = copy.deepcopy(_tables(data.draw(st.sampled_from(_NAMES))))
    for _ in range(data.draw(st.integers(1, 3))):
        holder = data.draw(st.sampled_from([h for h in _holders(tables) if h] or [tables]))
        key = data.draw(st.sampled_from(list(holder) if isinstance(holder, dict) else range(len(holder))))
        value = data.draw(_VALUES)
        if value is None:
            del holder[key]
        else:
            holder[key] = value
    _loads_or_is_refused(tomli_w.dumps(tables))


@settings(max_examples=100)
@given(st.sampled_from(_NAMES), st.integers(0, 12_000), st.integers(0, 40), st.text(max_size=6))
def test_changed_text(name: str, start: int, length: int, insert: str) -> None:
    text = _text(name)
    _loads_or_is_refused(text[:start] + insert + text[start + length :])

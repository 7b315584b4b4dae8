"""Some random sequences of orders, faults; `python -m tests.support.recorder.order_storm 200` runs more."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.recorder.order_storm import storm_once


@pytest.mark.parametrize("seed", [1, 2])
def test_nothing_breaks_a_rule_in_a_storm_of_orders_and_faults(
    tmp_path: Path, configs: Path, seed: int
) -> None:
    broken, log = storm_once(configs / "fr1.toml", tmp_path / "runs", seed)
    assert not broken, "\n".join([*broken, *log])

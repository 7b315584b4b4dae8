"""Calibration on cases whose overconfidence is known."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.gap.core.calibration import (
    Case,
    expected_calibration_error,
    fit_temperature,
    probabilities,
    reliability,
)


def _overconfident(seed: int, factor: float, count: int = 400) -> list[Case]:
    """Evidence exaggerated by `factor`; the right hypothesis is drawn from the honest posterior."""
    rng = np.random.default_rng(seed)
    cases = []
    for _ in range(count):
        honest = rng.normal(0, 2, 4)
        p = np.exp(honest - honest.max())
        truth = rng.choice(4, p=p / p.sum())
        cases.append(Case(np.zeros(4), factor * honest, tuple(k == truth for k in range(4))))
    return cases


def test_temperature_undoes_a_known_overconfidence() -> None:
    assert fit_temperature(_overconfident(0, 5.0)) == pytest.approx(5.0, rel=0.25)


def test_calibrated_probabilities_have_a_small_error_on_other_cases() -> None:
    temperature = fit_temperature(_overconfident(1, 5.0))
    errors = {}
    for name, t in (("raw", 1.0), ("calibrated", temperature)):
        tops = [(probabilities(c, t), c) for c in _overconfident(2, 5.0)]
        claimed = [float(p.max()) for p, _ in tops]
        right = [c.right[int(p.argmax())] for p, c in tops]
        errors[name] = expected_calibration_error(claimed, right)
    assert errors["raw"] > 0.15
    assert errors["calibrated"] < 0.06


def test_reliability_counts_every_answer_once() -> None:
    table = reliability([0.05, 0.55, 0.56, 1.0], [False, True, False, True])
    assert sum(b.n for b in table) == 4
    assert [b.observed for b in table] == [0.0, 0.5, 1.0]


def test_without_right_answers_there_is_nothing_to_calibrate() -> None:
    with pytest.raises(ValueError, match="right answer"):
        fit_temperature([Case(np.zeros(2), np.zeros(2), (False, False))])

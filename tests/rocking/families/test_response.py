"""Two families of one wall, of which one is slow or late: how they follow each other, and made alike."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from daq_app.rocking.families.response import compare

RATE_HZ = 1000.0


def rocking() -> tuple[np.ndarray, np.ndarray]:
    """Time, s, and a rotation, rad, shape (n,), whose half-cycles grow shorter."""
    time = np.arange(round(6.0 * RATE_HZ)) / RATE_HZ
    return time, 0.05 * np.exp(-0.3 * time) * np.sin(2.0 * np.pi * (0.7 * time + 0.1 * time**2))


def slow(values: np.ndarray, tau_s: float) -> np.ndarray:
    keep = np.exp(-1.0 / RATE_HZ / tau_s)
    return lfilter([1.0 - keep], [1.0, -keep], values)


@pytest.mark.parametrize("slower", ["reference", "follower"])
def test_a_slow_family_and_a_prompt_one_are_made_alike(slower):
    time, theta = rocking()
    pair = {"reference": theta, "follower": theta} | {slower: slow(theta, 0.02)}
    response = compare(time, pair["reference"], pair["follower"])
    assert abs(response.response_s) == pytest.approx(0.02, rel=0.05)

    x, y = response.made_alike(RATE_HZ, pair["reference"], pair["follower"])

    before = pair["reference"] - pair["follower"]
    assert np.std((x - y)[200:]) < 0.05 * np.std(before[200:])


def test_a_late_family_and_a_prompt_one_are_made_alike_and_gaps_stay_gaps():
    time, theta = rocking()
    late = np.concatenate([np.full(30, theta[0]), theta[:-30]])
    late[2000:2100] = np.nan
    response = compare(time, theta, late)
    assert response.delay_s == pytest.approx(0.03, abs=1e-3)

    x, y = response.made_alike(RATE_HZ, theta, late)

    assert np.isnan(x[2000:2100]).all() and np.isnan(y[2000:2100]).all()
    known = np.isfinite(x)
    assert known.sum() == theta.size - 100
    assert np.std((x - y)[known][200:]) < 0.05 * np.std(theta)
